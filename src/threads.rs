//! Results do not depend on the number of threads.

/// Keeps each decomposition and each product of dense matrices on one thread: split over threads their sums would run in
/// another order, and results would differ in the last digits with the number of threads. (The loops around them run in
/// parallel.)
pub fn sums_in_order() {
    faer::set_global_parallelism(faer::Par::Seq);
}
