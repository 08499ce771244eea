/* Wine 8 and older have no bcryptprimitives.dll, which every Rust program asks for random numbers. Of it only this function is used; the
   numbers come from advapi32, which has them in every Wine. For check.py; part of nothing that is handed out. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID buffer, ULONG length);

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T length) {
    while (length > 0) {
        ULONG piece = length > 65536 ? 65536 : (ULONG)length;
        if (!SystemFunction036(data, piece)) return FALSE;
        data += piece;
        length -= piece;
    }
    return TRUE;
}
