//! Text formats, detection and robustness, on small files of the shapes that labs deliver.

use num_complex::Complex64;
use proptest::prelude::*;

use super::decode::read_bytes;
use super::text::Notes;
use super::*;

/// The promise to every caller: equal lengths, ascending frequencies, no number that is none.
pub(super) fn assert_sound(contents: &Contents) {
    for frf in &contents.frfs {
        assert_eq!(frf.frequency_hz.len(), frf.value.len());
        assert!(frf.frequency_hz.windows(2).all(|w| w[0] < w[1]));
        assert!(frf.frequency_hz.iter().all(|f| f.is_finite() && *f >= 0.0));
        assert!(frf.value.iter().all(|v| v.is_finite()));
        assert!(
            frf.coherence
                .iter()
                .all(|c| c.len() == frf.value.len() && c.iter().all(|v| (0.0..=1.0).contains(v)))
        );
    }
    for record in &contents.times {
        assert!(
            record.sample_rate_hz.is_finite() && record.sample_rate_hz > 0.0 && record.start_s.is_finite()
        );
        for channel in &record.channels {
            assert_eq!(channel.samples.len(), record.len());
            assert!(channel.samples.iter().all(|v| v.is_finite()));
        }
        let _ = quality_warnings(record);
    }
    for other in &contents.others {
        assert!(other.abscissa.iter().all(|v| v.is_finite()) && other.value.iter().all(|v| v.is_finite()));
    }
}

fn read(bytes: impl AsRef<[u8]>) -> (Format, Contents, Vec<String>) {
    let mut notes = Notes::default();
    let (format, _, contents) =
        read_bytes(bytes.as_ref(), false, &mut notes).unwrap_or_else(|e| panic!("{e}"));
    assert_sound(&contents);
    (format, contents, notes.into_warnings())
}

fn problem(bytes: impl AsRef<[u8]>) -> String {
    read_bytes(bytes.as_ref(), false, &mut Notes::default())
        .map(|r| r.1)
        .unwrap_err()
        .to_string()
}

fn time(bytes: impl AsRef<[u8]>) -> (TimeRecord, Vec<String>) {
    let (_, mut contents, warnings) = read(bytes);
    assert_eq!((contents.times.len(), contents.frfs.len()), (1, 0));
    (contents.times.remove(0), warnings)
}

/// Sections of settings, each a table with its values below the names, then what was recorded: no forces, the motors' currents.
#[test]
fn the_last_of_titled_sections_is_the_record() {
    let mut text = String::from(
        "*** General Infos ***\t\t\t\nVersion\tDate\tSample Rate (Hz)\tDecimal Separator\n9\t2024-05-30:14:06:14\t100\tComma\n\
         \t\t\t\n*** Program ***\t\t\t\nStep Nb\tStroke (mm)\tRPM\tFeed (mm/s)\n0,000\t0,000\t0,000\t0,000\n\
         1,000\t50,000\t1500,000\t1,000\n2,000\t50,000\t320,000\t0,160\n3,000\t50,000\t1500,000\t1,000\n\t\t\t\n\
         *** Datas ***\t\t\t\nPosition (mm)\tI Torque (A)\tI Thrust (A)\tTorque Power (W)\n",
    );
    for i in 0..50 {
        text += &format!("-0,{i:03}\t4,5{:02}\t0,1{:02}\t1,000\n", i * 7 % 100, i * 3 % 100);
    }
    // Some end a name as C does.
    text.insert_str(text.find("Stroke").unwrap(), "Light\0");
    text.push_str(&"-0,050\t4,500\t0,100\t1,000\n".repeat(50));
    let (record, _) = time(&text);
    assert_eq!((record.sample_rate_hz, record.len()), (100.0, 100));
    let names: Vec<&str> = record.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "Position (mm)",
            "I Torque (A)",
            "I Thrust (A)",
            "Torque Power (W)"
        ]
    );
    assert!(record.channels.iter().all(|c| c.role == ChannelRole::Other));
    assert!((record.channels[1].samples[1] - 4.507).abs() < 1e-12);
}

/// Kistler's BioWare, which writes as DynoWare's younger sister does: no unit below `abs time (s)`.
#[test]
fn a_line_of_units_may_begin_with_none() {
    let mut text = String::from(
        "BioWare Version 5.4.8.0 Export\nDevice:\tPlate 1 9281CA\tPlate 1 9281CA\tPlate 1 9281CA\nRate (Hz):\t100.0\t100.0\t100.0\n\
         Description\t\nabs time (s)\tFx\tFz\tMz\n\tN\tkN\tN m\n",
    );
    for i in 0..40 {
        text += &format!("{:.6}\t{}.5\t0.{:03}\t1.25\n", f64::from(i) * 0.01, i, i);
    }
    let (record, _) = time(&text);
    assert_eq!((record.sample_rate_hz, record.len()), (100.0, 40));
    let roles: Vec<ChannelRole> = record.channels.iter().map(|c| c.role).collect();
    assert_eq!(
        roles,
        [ChannelRole::ForceX, ChannelRole::ForceZ, ChannelRole::TorqueZ]
    );
    assert!((record.channels[1].samples[7] - 7.0).abs() < 1e-9);
}

/// The twenty header lines of DynoWare 2.5, names and units, with one separator.
fn dynoware(separator: char, rows: &str) -> String {
    let text = "DynoWare,Version 2.5.1.2\nPath:,C:\\Messung\nFilename:,cut7.dwd\nConfig ID:,a.cfg\nSetup ID:,0\n\
        Manipulated:,0\nFilename 1:, \nFilename 2:, \nDate:, \nTime:, \nSampling rate [Hz]:,10000\n\
        Measuring time [s]:,50\nDelay time [s]:,0\nCycle time [s]:,0\nCycles:,1\nSamples per channel:,500001\n\
        Cycle interval:,0\nCycle No:,1\nTime,AFx,FY2,Mz,kladivo\ns,kN,N,Nm,V\n";
    text.replace(',', &separator.to_string()) + rows
}

#[test]
fn dynoware_exports() {
    let rows = "8.0000,0.001,-2.5,1.25,0.1\n8.0001,0.002,-3.5,1.5,0.2\n8.0002,0.003,-4.5,1.75,0.3\n";
    for (separator, decimal) in [(',', '.'), (';', '.'), (';', ','), ('\t', '.'), ('\t', ',')] {
        let rows: String = rows
            .chars()
            .map(|c| match c {
                ',' => separator,
                '.' => decimal,
                c => c,
            })
            .collect();
        for end in ["\n", "\r\n"] {
            let text = dynoware(separator, &rows).replace('\n', end);
            let (format, contents, warnings) = read(&text);
            assert!(warnings.is_empty(), "{warnings:?}");
            assert_eq!(format, Format::DynoWare);
            let record = &contents.times[0];
            assert_eq!(
                (record.sample_rate_hz, record.start_s, record.len()),
                (1e4, 8.0, 3)
            );
            assert_eq!(record.channels[0].samples, [1.0, 2.0, 3.0], "kN");
            assert_eq!(record.channels[1].samples, [-2.5, -3.5, -4.5]);
            let roles: Vec<ChannelRole> = record.channels.iter().map(|c| c.role).collect();
            use ChannelRole::*;
            assert_eq!(roles, [ForceX, ForceY, TorqueZ, Other]);
        }
    }
}

#[test]
fn latin_1_paths_and_byte_order_marks() {
    let text = dynoware(',', "0.0,1,2,3,4\n0.0001,1,2,3,4\n");
    let latin: Vec<u8> = text
        .replace("Messung", "@")
        .bytes()
        .map(|b| if b == b'@' { 0xFC } else { b })
        .collect();
    let marked = [&b"\xEF\xBB\xBF"[..], text.as_bytes()].concat();
    let wide: Vec<u8> = [0xFF, 0xFE]
        .into_iter()
        .chain(text.encode_utf16().flat_map(u16::to_le_bytes))
        .collect();
    for bytes in [latin, marked, wide] {
        assert_eq!(time(bytes).0.len(), 2);
    }
}

#[test]
fn short_headers_and_plain_tables() {
    let german = "Name:;cut 01\nDate:;2021-03-16 10:07:47\nSampling rate [Hz]:;5000\nNumber of channels:;3\n\
        Time;Fx;Fy;Fz\ns;N;N;N\n0,0000;-24,89;-26,34;-7,633\n0,0002;-37,38;11,94;-2,800\n0,0004;-18,87;-1,57;-7\n";
    let (record, warnings) = time(german);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(record.sample_rate_hz, 5000.0);
    assert_eq!(
        record.channel(ChannelRole::ForceY).unwrap().samples,
        [-26.34, 11.94, -1.57]
    );
    let plain = "time_s,fx_n,fy_kn,mz_nm,ax_g\n0.0000,1,2,3,1\n0.0010,1,2,3,1\n0.0020,1,2,3,1\n";
    let (record, warnings) = time(plain);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(record.sample_rate_hz, 1000.0);
    let first: Vec<f64> = record.channels.iter().map(|c| c.samples[0]).collect();
    assert_eq!(first, [1.0, 2000.0, 3.0, 9.80665]);
    let units: Vec<&str> = record.channels.iter().map(|c| c.quantity_and_unit().1).collect();
    assert_eq!(units, ["N", "N", "N·m", "m/s²"]);
    let blanks = "t [ms]  Fx [lbf]  Mz [in-lbf]\n 0.0 1 1\n 0.5 1 1\n 1.0 1 1\n";
    let (record, _) = time(blanks);
    assert_eq!(record.sample_rate_hz, 2000.0);
    approx::assert_relative_eq!(record.channels[0].samples[0], 4.4482216152605);
    approx::assert_relative_eq!(record.channels[1].samples[0], 0.1129848290276167);
    let quoted = "\"time_s\",\"fx_n\"\n\"0,000\",\"1,5\"\n\"0,001\",\"2,5\"\n\"0,002\",\"3,5\"\n";
    assert_eq!(time(quoted).0.channels[0].samples, [1.5, 2.5, 3.5]);
    let no_time = "Sampling rate [kHz]:,2\nFx,Fy\nN,N\n1,2\n3,4\n5,6\n";
    let (record, warnings) = time(no_time);
    assert_eq!((record.sample_rate_hz, warnings.len()), (2000.0, 1));
}

#[test]
fn units_that_are_missing_or_wrong_are_said() {
    let (record, warnings) = time("time_s,Fx,Fy [g],Fz [V],Fx12 [N]\n0,1,2,3,4\n1,1,2,3,4\n2,1,2,3,4\n");
    use ChannelRole::*;
    let roles: Vec<ChannelRole> = record.channels.iter().map(|c| c.role).collect();
    assert_eq!(roles, [ForceX, Other, ForceZ, Other]);
    assert!(
        warnings
            .iter()
            .any(|w| w == "Fx: no unit that is understood: N assumed"),
        "{warnings:?}"
    );
    assert!(
        warnings.iter().any(|w| w.starts_with("Fz [V]: a force in volts")),
        "{warnings:?}"
    );
}

#[test]
fn decimal_commas_between_commas() {
    let rows = "0,000000,0,013079,-0,000435965,0,1,5\n0,000100,0,012,-0,0004,0,1,6\n0,000200,0,0125,0,0,1,7\n\
        0,000300,0,013,-0,0005,0,1,6\n";
    let text = dynoware(',', rows).replace("kN,N,Nm,V", "N,N,Nm,V");
    let (record, warnings) = time(text);
    assert_eq!(record.channels[0].samples, [0.013079, 0.012, 0.0125, 0.013]);
    assert_eq!(record.channels[1].samples, [-0.000435965, -0.0004, 0.0, -0.0005]);
    assert_eq!(record.channels[3].samples, [1.5, 1.6, 1.7, 1.6]);
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("decimal commas between commas")),
        "{warnings:?}"
    );
}

/// A table at 1 kHz with one channel, times made by `at`.
fn clock(samples: usize, at: impl Fn(usize) -> String) -> String {
    (0..samples).fold(String::from("time_s,fx_n\n"), |text, i| {
        text + &format!("{},{}\n", at(i), i % 7)
    })
}

#[test]
fn the_time_column_is_checked() {
    let (record, warnings) = time(clock(100, |i| {
        format!("{:.3}", (if i < 50 { i } else { i + 3 }) as f64 * 1e-3)
    }));
    assert_eq!(record.sample_rate_hz, 1000.0);
    assert!(
        warnings.len() == 1 && warnings[0].starts_with("3 samples dropped at 1 place "),
        "{warnings:?}"
    );
    // Filled by a straight line: 49 % 7 = 0 before the gap, 50 % 7 = 1 behind it.
    assert_eq!((record.filled.len(), &record.filled[0]), (1, &(50..53)));
    assert_eq!(record.len(), 103);
    assert_eq!(record.channels[0].samples[49..54], [0.0, 0.25, 0.5, 0.75, 1.0]);
    // One sample, in times without trailing zeros.
    let (record, warnings) = time(clock(100, |i| {
        format!("{}", (if i < 50 { i } else { i + 1 }) as f64 * 1e-3)
    }));
    assert_eq!(record.len(), 101);
    assert!(
        warnings[0].starts_with("1 samples dropped at 1 place "),
        "{warnings:?}"
    );
    // 25.6 kHz in whole microseconds: most steps are 39 µs, their median would be 25,641 Hz.
    let (record, warnings) = time(clock(5000, |i| format!("{:.6}", i as f64 / 25600.0)));
    approx::assert_relative_eq!(record.sample_rate_hz, 25600.0, max_relative = 1e-5);
    assert!(warnings.is_empty(), "{warnings:?}");
    // 12.8 kHz printed with four digits: single steps are 0 or 0.1 ms.
    let (record, warnings) = time(clock(5000, |i| format!("{:.4}", i as f64 / 12800.0)));
    approx::assert_relative_eq!(record.sample_rate_hz, 12800.0, max_relative = 3e-4);
    assert!(warnings.is_empty(), "{warnings:?}");
    // The header describes the recording; this export kept every second sample.
    let text = dynoware(
        ',',
        "0.0000,1,1,1,1\n0.0002,2,2,2,2\n0.0004,3,3,3,3\n0.0006,4,4,4,4\n",
    );
    let (record, warnings) = time(text);
    assert_eq!(record.sample_rate_hz, 5000.0);
    assert!(
        warnings.iter().any(|w| w.contains("the time column is taken")),
        "{warnings:?}"
    );
    assert!(problem(clock(10, |_| "1.0".into())).contains("does not rise"));
}

#[test]
fn bad_rows_name_their_line() {
    let rows = |bad: &str| format!("time_s,fx_n\n0,1\n1,1\n2,1\n3,1\n{bad}\n5,1\n");
    for bad in ["4", "4,x", "4,1,1", "4,1.0.0", "4;1"] {
        let error = read_bytes(rows(bad).as_bytes(), false, &mut Notes::default()).unwrap_err();
        assert_eq!(error.line, Some(6), "{bad}: {error}");
    }
    assert!(problem(rows("4,NaN")).contains("no valid number"));
    assert!(problem(rows("4,")).contains("no valid number"));
    let (record, warnings) = time("time_s,fx_n\n0,1\n1,1\n2,1\n3,1\n4");
    assert_eq!((record.len(), warnings.len()), (4, 1));
}

#[test]
fn frf_tables() {
    let (format, contents, warnings) = read(
        "frequency_hz,re(1X/1X),im(1X/1X),re(2-Z/1Y),im(2-Z/1Y)\n1,1e-6,-2e-7,3,4\n1.5,5,6,7,8\n2,1,1,1,1\n",
    );
    assert!(warnings.is_empty() && format == Format::FrfCsv, "{warnings:?}");
    assert_eq!(contents.frfs[1].name, "2-Z/1Y");
    assert_eq!(
        contents.frfs[1].response,
        Some(Dof {
            node: 2,
            axis: Axis::Z,
            negative: true
        })
    );
    assert_eq!(contents.frfs[0].value[0], Complex64::new(1e-6, -2e-7));
    assert_eq!(contents.frfs[0].quantity, None);
    let (_, contents, _) = read("frequency_hz;re;im\n1,5;2,5;-3,5\n2;4;5\n3;6;7\n");
    assert_eq!(
        (contents.frfs[0].frequency_hz[0], contents.frfs[0].value[0].im),
        (1.5, -3.5)
    );
    let (_, contents, _) = read("frequency_hz\tmagnitude\tphase_deg\n1\t2\t90\n2\t2\t180\n3\t1\t-90\n");
    approx::assert_relative_eq!(contents.frfs[0].value[0].im, 2.0);
    approx::assert_relative_eq!(contents.frfs[0].value[1].re, -2.0);
    let (_, contents, warnings) = read("frequency_hz,re,im\n0,nan,0\n1,1,1\n2,1,1\n3,,1\n");
    assert_eq!((contents.frfs[0].frequency_hz.len(), warnings.len()), (2, 1));
    let (format, contents, _) = read("0.0 2.04e-03 0.0\n0.5 1e-6 -1e-8\n1.0 2e-6 -2e-8\n");
    assert_eq!((format, contents.frfs[0].value.len()), (Format::FrfText, 3));
    for (text, what) in [
        ("frequency_hz,re,re\n1,1,1\n2,1,1\n", "twice"),
        (
            "frequency_hz,re(1X/1X),im(1X/1Y)\n1,1,1\n2,1,1\n",
            "do not make an FRF",
        ),
        (
            "frequency_hz,re,im,depth\n1,1,1,1\n2,1,1,1\n",
            "not part of an FRF",
        ),
        ("1 2 3 4\n1 2 3 4\n2 3 4 5\n", "without names"),
        ("3 2 3\n1 2 3\n2 3 4\n", "without names"),
    ] {
        assert!(problem(text).contains(what), "{text}: {}", problem(text));
    }
}

/// The tables of a Bode plot: magnitudes in dB and phases in degrees, with the units said in every way, or not at all.
#[test]
fn frf_tables_in_decibels() {
    // 20 dB at 0°, 40 dB at −90°, −20 dB at −180°, 0 dB at 170°.
    let rows = |separator: &str| {
        let lines = [(1, 20, 0), (2, 40, -90), (3, -20, -180), (4, 0, 170)];
        let row = |(f, m, p)| [f, m, p].map(|v: i32| v.to_string()).join(separator) + "\n";
        lines.map(row).concat()
    };
    for (heading, what_it_is, remarks) in [
        ("Frequency (Hz),Magnitude (dB),Phase (deg)", None, 0),
        ("frequency_hz,magnitude_db,phase_deg", None, 0),
        ("freq [Hz],FRF_mag_dB,FRF_phase_deg", None, 0),
        ("Frequency [Hz],Amplitude [dB],Phase [°]", None, 0),
        (
            "Frequency [Hz],Magnitude [dB m/N],Phase [degrees]",
            Some(Quantity::Receptance),
            0,
        ),
        (
            "Frequency (Hz),Magnitude (dB re 1 (m/s²)/N),Phase (deg)",
            Some(Quantity::Accelerance),
            0,
        ),
        ("Frequency,Magnitude,Phase", None, 2),
        ("f,mag,phase", None, 2),
    ] {
        let (_, contents, warnings) = read(format!("{heading}\n{}", rows(",")));
        let frf = &contents.frfs[0];
        assert_eq!(
            (frf.quantity, warnings.len()),
            (what_it_is, remarks),
            "{heading}: {warnings:?}"
        );
        assert!(frf.response.is_none(), "{heading}");
        approx::assert_relative_eq!(frf.value[0].re, 10.0, max_relative = 1e-12);
        approx::assert_relative_eq!(frf.value[1].im, -100.0, max_relative = 1e-12);
        approx::assert_relative_eq!(frf.value[2].re, -0.1, max_relative = 1e-12);
    }
    // A reference other than 1, a unit that is not SI, and units below the names.
    let (_, contents, _) = read(format!(
        "Frequency (Hz),Magnitude (dB re 1e-3 mm/N),Phase (deg)\n{}",
        rows(",")
    ));
    approx::assert_relative_eq!(contents.frfs[0].value[0].re, 1e-5, max_relative = 1e-12);
    let (_, contents, warnings) = read(format!(
        "Frequency\tMagnitude\tPhase\nHz\tdB\tdeg\n{}",
        rows("\t")
    ));
    assert!(warnings.is_empty(), "{warnings:?}");
    approx::assert_relative_eq!(contents.frfs[0].value[0].re, 10.0, max_relative = 1e-12);
    // Several FRFs.
    let two =
        "f (Hz),1X/1X Mag (dB),1X/1X Phase (deg),2Z/1X Mag (dB),2Z/1X Phase (deg)\n1,20,0,0,0\n2,20,0,0,90\n";
    let (_, contents, _) = read(two);
    assert_eq!(
        contents.frfs[1].response.map(|d| d.to_string()).as_deref(),
        Some("2Z")
    );
    approx::assert_relative_eq!(contents.frfs[1].value[1].im, 1.0, max_relative = 1e-12);
}

/// What the units behind the names of linear columns say, and phases whose heading says none.
#[test]
fn units_behind_frf_columns() {
    let (_, contents, warnings) = read("Frequency (Hz),Real (g/N),Imag (g/N)\n1,1,2\n2,3,4\n3,5,6\n");
    assert_eq!(contents.frfs[0].quantity, Some(Quantity::Accelerance));
    approx::assert_relative_eq!(contents.frfs[0].value[0].re, 9.80665);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let (_, contents, _) = read("f (Hz),Real ((m/s)/N),Imag ((m/s)/N)\n1,1,2\n2,3,4\n3,5,6\n");
    assert_eq!(contents.frfs[0].quantity, Some(Quantity::Mobility));
    let phases = |phases: [f64; 4]| {
        let rows: Vec<String> = (0..4).map(|k| format!("{},1,{}\n", k + 1, phases[k])).collect();
        format!("frequency,magnitude,phase\n{}", rows.concat())
    };
    // Radians in one turn; radians unwrapped over more than one are not told from few degrees.
    let (_, contents, warnings) = read(phases([0.0, -1.5, -3.1, 3.1]));
    approx::assert_relative_eq!(contents.frfs[0].value[1].im, -(1.5_f64.sin()));
    assert!(warnings.iter().any(|w| w.contains("radians")), "{warnings:?}");
    assert!(problem(phases([0.0, -3.0, -6.0, -9.0])).contains("degrees, or radians"));
    // A jump of more than half a turn from line to line is none of unwrapped radians.
    let (_, contents, _) = read(phases([0.0, -30.0, -60.0, -90.0]));
    approx::assert_relative_eq!(contents.frfs[0].value[3].im, -1.0);
    // A magnitude with a unit is no level, whatever its sign.
    let (_, contents, _) = read("f,Magnitude [m/N],phase_deg\n1,1,0\n2,-1,0\n3,1,0\n");
    approx::assert_relative_eq!(contents.frfs[0].value[1].re, -1.0);
}

#[test]
fn tables_of_other_programs() {
    let open_modal = "frq,amp_real,amp_imag\n0.0,0.07,0.0\n0.3125,-0.0002,-0.028\n0.625,-0.002,-0.011\n";
    let (format, contents, _) = read(open_modal);
    assert_eq!((format, contents.frfs.len()), (Format::FrfCsv, 1));
    assert_eq!(contents.frfs[0].frequency_hz, [0.0, 0.3125, 0.625]);
    assert_eq!(contents.frfs[0].value[1], Complex64::new(-0.0002, -0.028));
    let named = "freq [Hz],H_1X_2Z_real,H_1X_2Z_imag\n1,1,2\n2,3,4\n3,5,6\n";
    let frf = &read(named).1.frfs[0];
    assert_eq!(frf.response.map(|d| d.to_string()).as_deref(), Some("1X"));
    assert_eq!(frf.reference.map(|d| d.to_string()).as_deref(), Some("2Z"));
    // One signal: the unit of a ratio stands as (a)(b).
    let one = "H1,2 Run 5\nFreq\tReal\tImag\nUnits:\nHz\t(m/s2)(N)\t\n\n0.0\t1.0\t0.0\n0.5\t2.0\t-1.0\n1.0\t3.0\t-2.0\n";
    let (_, contents, _) = read(one);
    assert_eq!(contents.frfs[0].quantity, Some(Quantity::Accelerance));
    assert_eq!(contents.frfs[0].value[2], Complex64::new(3.0, -2.0));
    let several = "Data written for run 7\n\tH1,2\t\t\t\tH1,3\t\t\t\n\
        Freq\tReal\tImag\tMag\tPhase\tReal\tImag\tMag\tPhase\nx\nUnits:\n\
        Hz\tmm/N\tmm/N\tmm/N\tdeg\tmm/N\tmm/N\tmm/N\tdeg\n\n\
        0.0\t1.0\t0.0\t1\t0\t4.0\t-1.0\t4\t-14\n0.5\t2.0\t-1.0\t2\t-27\t5.0\t-2.0\t5\t-22\n\
        1.0\t3.0\t-2.0\t4\t-34\t6.0\t-3.0\t7\t-27\n";
    let (_, contents, _) = read(several);
    let names: Vec<&str> = contents.frfs.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["H1,2", "H1,3"]);
    assert_eq!(contents.frfs[1].quantity, Some(Quantity::Receptance));
    approx::assert_relative_eq!(contents.frfs[1].value[1].re, 5e-3, max_relative = 1e-12);
    let dofs = "Response: 3Z\nReference: 1-X\nfrequency_hz,re,im\n1,1,2\n2,3,4\n3,5,6\n";
    let frf = &read(dofs).1.frfs[0];
    assert_eq!(frf.response.map(|d| d.to_string()).as_deref(), Some("3Z"));
    assert_eq!(frf.reference.map(|d| d.to_string()).as_deref(), Some("1-X"));
}

/// Lines above the numbers say what the columns are: the text export of Simcenter Testlab has no line of names, other
/// programs name all columns but the frequencies.
#[test]
fn columns_that_header_lines_describe() {
    let testlab = "Resolution\t0.5 Hz\t\t\t\nX axis\t0-1 Hz\t\t\t\nX axis unit\tHz\t\t\t\nValue type\tComplex\t\t\t\n\
        Y axis unit\tg/N\t\t\t\nReference actual sensitivity\t22.7 mV/N\t\t\t\nReference DOF id\tPoint:10:-Z\t\t\t\n\
        DOF id\tPoint:3:+Z\t\t\t\nFunction class\tFRF\t\t\t\nCreated\tTue Feb 23 2021\t\t\t\n\
        \x20  0.0e+00\t   1.0e+00\t   0.0e+00\t\t\n   5.0e-01\t   2.0e+00\t  -1.0e+00\t\t\n\
        \x20  1.0e+00\t   3.0e+00\t  -2.0e+00\t\t\n";
    let (_, contents, _) = read(testlab);
    let frf = &contents.frfs[0];
    assert_eq!(frf.frequency_hz, [0.0, 0.5, 1.0]);
    assert_eq!(frf.quantity, Some(Quantity::Accelerance));
    approx::assert_relative_eq!(frf.value[2].im, -2.0 * 9.80665, max_relative = 1e-12);
    assert_eq!(frf.response.map(|d| d.to_string()).as_deref(), Some("3Z"));
    assert_eq!(frf.reference.map(|d| d.to_string()).as_deref(), Some("10-Z"));
    // A spectrum is no FRF, whatever its header says.
    assert!(!problem(testlab.replace("\tFRF\t", "\tSpectrum\t")).is_empty());
    let analyser = "CSVFormatType;Spectrum2DComplex\nAxisUnit;Hz\nSignals;2\n\n\
        ';Signal 2 (Real);Signal 2 (Imag.);Signal 3 (Real);Signal 3 (Imag.)\n\
        ';(m/s^2)/N;(m/s^2)/N;(m/s^2)/N;(m/s^2)/N\n\
        0,0E+00;1,5;0,0;4,0;-1,0\n5,0E-01;2,5;-1,0;5,0;-2,0\n1,0E+00;3,5;-2,0;6,0;-3,0\n";
    let (_, contents, _) = read(analyser);
    let names: Vec<&str> = contents.frfs.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["Signal 2", "Signal 3"]);
    assert_eq!(contents.frfs[0].value[1], Complex64::new(2.5, -1.0));
    assert_eq!(contents.frfs[1].frequency_hz, [0.0, 0.5, 1.0]);
    assert_eq!(contents.frfs[1].quantity, Some(Quantity::Accelerance));
}

/// Brüel & Kjær's PULSE: header lines say what the columns are, lines of words stand below the rows.
#[test]
fn exports_of_pulse() {
    let export = |data_type: &str, unit: &str, function: &str, over: &str, rows: &str| {
        format!(
            "Header Size:\t 79\t \t \r\nPulse Version:\t 80\t \t \r\nDecimal Symbol:\t.\t \t \r\nData Type:\t{data_type}\t \t \r\n\
             X-Axis unit:\t{over}\t \t \r\n\t \t \t \r\nAmplitudeUnit:\t{unit}\t \t \r\nFunction:\t{function}\t \t \r\n\
             Ref_Signal:\thammer\t \t \r\nSignal:\tPCB3\t \t \r\nTitle:\t{function} H1(PCB3,hammer)\t \t \r\n\
             Z-index:\t \t1\t \r\nTime:\t \t10:53:34:432\t \r\nZ-axis:\t \t 0.0000000000e+000\t \r\n{rows}\
             TagsBegin:\t \t \t \r\nOverLoad:\t \tFalse\t \r\nAverageNumber: []\t \t 3.00000e+000\t \r\nTagsEnd:\t \t \t \r\n"
        )
    };
    let rows: String = (0..5)
        .map(|k| {
            format!(
                "{}\t {:.10e}\t{:e}\t{:e}\t \r\n",
                k + 1,
                0.25 * f64::from(k),
                1 + k,
                -k
            )
        })
        .collect();
    // Latin-1, as the program writes it.
    let bytes = |text: String| -> Vec<u8> { text.chars().map(|c| c as u8).collect() };
    let frf = export("Complex", "(m/s²)/N", "Frequency Response", "Hz", &rows);
    let (_, contents, warnings) = read(bytes(frf));
    let found = &contents.frfs[0];
    assert_eq!(found.quantity, Some(Quantity::Accelerance));
    assert_eq!(found.frequency_hz, [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert_eq!(found.value[2], Complex64::new(3.0, -2.0));
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("lines below the last row, from \"TagsBegin:\" on")),
        "{warnings:?}"
    );
    // Without the sensor's sensitivity: volts for each newton.
    let (_, contents, warnings) = read(bytes(export("Complex", "V/N", "Frequency Response", "Hz", &rows)));
    assert_eq!(contents.frfs[0].quantity, None);
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("V/N counts in volts: not calibrated")),
        "{warnings:?}"
    );
    let cross = export("Complex", "(m/s²)N", "Cross-spectrum", "Hz", &rows);
    assert!(problem(bytes(cross)).contains("a PULSE export of Cross-spectrum over Hz"));
    let rows: String = (0..5)
        .map(|k| format!("{}\t {:.10e}\t{:e}\t \r\n", k + 1, 0.5e-3 * f64::from(k), k))
        .collect();
    let (record, _) = time(bytes(export("Real", "m/s²", "Time", "s", &rows)));
    assert_eq!(record.sample_rate_hz, 2000.0);
    let signal = record.channels.iter().find(|c| c.name == "PCB3").unwrap();
    assert_eq!((signal.quantity_and_unit().1, signal.samples[3]), ("m/s²", 3.0));
    let spectrum = export("Real", "(m/s²)²", "Autospectrum", "Hz", &rows);
    assert!(problem(bytes(spectrum)).contains("Autospectrum"));
}

/// TwinCAT Scope: keys above each channel, times in milliseconds, `EOF` at the end.
#[test]
fn exports_of_twincat_scope() {
    let one = "Name\tScope Project1\t\nFile\tC:\\a.csv\t\nStarttime of export\t132930981542700000\tMittwoch\t09:15:54.270\n\n\n\
        Name\tFx\nSymbolComment\t\nData-Type\tREAL64\nSampleTime\t10\nSymbolName\tMeasurement_Values.Force.x\nUnit\tN\n\
        Unit Offset\t0\n\n\n0\t1.5\n10\t2.5\n20\t3.5\n30\t4.5\nEOF\n";
    let (record, _) = time(one);
    assert_eq!((record.sample_rate_hz, record.channels.len()), (100.0, 1));
    let channel = &record.channels[0];
    assert_eq!((channel.name.as_str(), channel.role), ("Fx", ChannelRole::ForceX));
    assert_eq!(channel.samples, [1.5, 2.5, 3.5, 4.5]);
    let two = "Name\tScope Project1\t\n\nName\tFx\tName\tFy\nData-Type\tREAL64\tData-Type\tREAL64\n\
        SampleTime\t10\tSampleTime\t10\nSymbolName\tA.x\tSymbolName\tA.y\nUnit\tN\tUnit\tN\n\
        Unit Offset\t0\tUnit Offset\t0\n\n0\t1.5\t0\t7\n10\t2.5\t10\t8\n20\t3.5\t20\t9\n30\t4.5\t30\t9\nEOF\n";
    let (record, _) = time(two);
    let fy = record.channels.iter().find(|c| c.name == "Fy").unwrap();
    assert_eq!(
        (fy.role, fy.samples[2], record.sample_rate_hz),
        (ChannelRole::ForceY, 9.0, 100.0)
    );
}

/// A running number in front, with a name or without (pandas).
#[test]
fn frf_tables_behind_a_running_number() {
    for name in ["", "Unnamed: 0", "No.", "index"] {
        let (_, contents, _) = read(format!(
            "{name},Frequency (Hz),Real,Imag\n0,1.0,2,3\n1,1.5,4,5\n2,2.0,6,7\n3,2.5,8,9\n"
        ));
        assert_eq!(contents.frfs[0].frequency_hz, [1.0, 1.5, 2.0, 2.5], "{name}");
        assert_eq!(contents.frfs[0].value[1], Complex64::new(4.0, 5.0));
    }
}

/// Autospectra over Hz beside which a window is named are no record over time.
#[test]
fn spectra_of_an_analyser_are_no_times() {
    let table = "CSVFormatType;Spectrum2DReal\nAxisUnit;Hz\nSignals;2\n;\nName;Signal 1;Signal 2\n\
        FunctionType;SpectrumAuto;SpectrumAuto\nUnit;(N)^2;(m/s^2)^2\nTimeWeighting;Hanning;Hanning\n;\n\
        ';Signal 1;Signal 2\n';(N)^2;(m/s^2)^2\n0,0;1,5;4,0\n0,5;2,5;5,0\n1,0;3,5;6,0\n1,5;3,5;6,0\n";
    let told = problem(table);
    assert!(
        told.contains("spectra over Hz (SpectrumAuto) without phases"),
        "{told}"
    );
}

#[test]
fn lines_below_a_table_are_left_out_and_told() {
    let rows = "time_s,fx_n\n0,1\n0.001,2\n0.002,3\n0.003,4\n";
    let (record, warnings) = time(format!("{rows}EOF\n"));
    assert_eq!(record.channels[0].samples, [1.0, 2.0, 3.0, 4.0]);
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("1 line below the last row, \"EOF\", is no row")),
        "{warnings:?}"
    );
    // Words within a table are still an error, with their line.
    assert!(problem(format!("{rows}Cycle: 2\n0.004,5\n")).contains("2 numbers are expected here"));
}

/// Milliseconds called time, or a count of samples.
#[test]
fn times_that_go_up_by_a_second_or_more_are_told() {
    let table = |step: usize| -> String {
        let rows = (0..300).map(|k| format!("{},{}\n", k * step, (k * 7) % 13));
        std::iter::once("time,fx_n\n".to_owned()).chain(rows).collect()
    };
    for step in [1, 10] {
        let (_, warnings) = time(table(step));
        let told = format!("300 samples, one every {step}.0");
        assert!(warnings.iter().any(|w| w.contains(&told)), "{warnings:?}");
    }
}

/// A row for each channel: a message that can be read, and says what to do.
#[test]
fn rows_and_columns_exchanged_are_told() {
    let row: Vec<String> = (0..3000).map(|k| format!("{}.5", (k * 7) % 11)).collect();
    let told = problem(format!("{0}\n{0}\n{0}\n{0}\n{0}\n", row.join(" ")));
    assert!(told.len() < 3000, "{}", told.len());
    assert!(told.contains("and 2988 more"), "{told}");
    assert!(
        told.contains("5 rows of 3000 numbers are one row a channel"),
        "{told}"
    );
}

#[test]
fn times_without_names_are_no_frequencies() {
    let record: String = (0..200)
        .map(|i| format!("{:.4} {} {}\n", f64::from(i) * 5e-3, i % 9, i % 5))
        .collect();
    assert!(problem(&record).contains("fit a time"), "{}", problem(&record));
    assert!(problem(&record).contains("time_s,force_n"));
    let under_a_heading = format!("Frequency in kHz\n{record}");
    assert_eq!(read(under_a_heading).1.frfs.len(), 1);
}

#[test]
fn names_of_channels_carry_their_units() {
    let (record, _) = time("time_s,force_n,acc_m_s2,acc2_m/s2\n0,1,2,3\n0.001,1,2,3\n0.002,1,2,3\n");
    let units: Vec<&str> = record.channels.iter().map(|c| c.quantity_and_unit().1).collect();
    assert_eq!(units, ["N", "m/s²", "m/s²"]);
}

#[test]
fn a_last_row_cut_within_its_number_is_left_out_and_told() {
    let rows =
        |end: &str| format!("time_s,fx_n\n0.000,1.25\n0.001,1.50\n0.002,1.75\n0.003,2.00\n0.004,2.25\n{end}");
    let (record, warnings) = time(rows("0.005,2.5"));
    assert_eq!((record.len(), warnings.len()), (5, 1), "{warnings:?}");
    for whole in ["0.005,2.50", "0.005,2.5\n", "0.005,2.500"] {
        let (record, warnings) = time(rows(whole));
        assert_eq!((record.len(), warnings.len()), (6, 0), "{whole}: {warnings:?}");
    }
}

#[test]
fn dropped_samples_beyond_a_tenth_are_refused() {
    let problem = problem(clock(100, |i| {
        format!("{:.3}", (if i < 50 { i } else { i + 30 }) as f64 * 1e-3)
    }));
    assert!(problem.contains("30 samples dropped at 1 places"), "{problem}");
}

#[test]
fn cutpro_files() {
    let text = "0.0\t2.04e-01\t0.0\tFreq\tHz\tReal\tmm/N\tImag\tmm/N\n0.5\t2e-4\t-1e-5\n1.0\t3e-4\t-2e-5\n";
    let (format, contents, warnings) = read(text);
    let frf = &contents.frfs[0];
    assert_eq!(
        (format, frf.quantity),
        (Format::CutproFrf, Some(Quantity::Receptance))
    );
    approx::assert_relative_eq!(frf.value[1].re, 2e-7, max_relative = 1e-12);
    assert_eq!(frf.frequency_hz, [0.0, 0.5, 1.0]);
    assert!(
        warnings.iter().any(|w| w.contains("0 Hz line is invalid")),
        "{warnings:?}"
    );
}

#[test]
fn foreign_formats_are_named_with_a_way_out() {
    for (bytes, what) in [
        (&b"TDSm\x0e\0\0\0"[..], "TDMS"),
        (b"MATLAB 5.0 MAT-file, Platform", "MAT-file"),
        (b"MATLAB 7.3 MAT-file, Platform", "unknown version"),
        (b"\x89HDF\r\n\x1a\n\0", "HDF5"),
        (b"PK\x03\x04\x14", "xlsx"),
        (b"LabVIEW Measurement\t\nWriter_Version\t2\n", "LabVIEW"),
        (b"(-0.07+2.6e-08j)\n(-0.17-0.1j)\n", "frequency axis is missing"),
        (b"\x00\x01 Kistler DynoWare \x02", ".dwd"),
        (b"\x00\x01\x02", "unknown format"),
        (b"", "empty"),
        (b"hello world\n", "no format known"),
    ] {
        let error = read_bytes(bytes, false, &mut Notes::default()).unwrap_err();
        assert!(error.problem.contains(what), "{error}");
        assert!(error.remedy.is_some() || what == "empty", "{error}");
    }
    assert!(
        read_bytes(b"\x00\x01\x02", true, &mut Notes::default())
            .unwrap_err()
            .problem
            .contains(".dwd")
    );
}

#[test]
fn degrees_of_freedom_as_text() {
    for (text, node, axis, negative, shown) in [
        ("1X", 1, Axis::X, false, "1X"),
        ("12-Z", 12, Axis::Z, true, "12-Z"),
        ("3+y", 3, Axis::Y, false, "3Y"),
    ] {
        let dof: Dof = text.parse().unwrap();
        assert_eq!(
            (dof, dof.to_string().as_str()),
            (Dof { node, axis, negative }, shown)
        );
    }
    for text in ["", "X", "1", "1W", "1--X", "99999999999999999999X", "1XX"] {
        assert!(text.parse::<Dof>().is_err(), "{text}");
    }
}

fn small_files() -> impl Strategy<Value = Vec<u8>> {
    prop::sample::select(vec![
        dynoware(',', "0.0,1,2,3,4\n0.0001,1.5,2,3,4\n0.0002,1,2,3,4\n").into_bytes(),
        dynoware(
            ',',
            "0,000000,0,5,1,2,3,0\n0,000100,0,5,1,2,3,0\n0,000200,0,1,2,3,0\n",
        )
        .into_bytes(),
        dynoware(';', "0,0;1;2;3;4\n0,0001;1,5;2;3;4\n0,0002;1;2;3;4\n").into_bytes(),
        b"time_s,fx_n,fy_n\n0.0,1,2\n0.1,3,4\n0.2,5,6\n0.3,5,6\n".to_vec(),
        b"frequency_hz,re(1X/1X),im(1X/1X)\n1,1,-1\n2,2,-2\n3,3,-3\n".to_vec(),
        b"\"frequency_hz\";\"magnitude\";\"phase_deg\"\n\"1,5\";\"2\";\"3\"\n\"2\";\"2\";\"3\"\n".to_vec(),
        b"0.0 2.0e-07 0.0 Freq Hz Real m/N Imag m/N\n0.5 2e-4 -1e-5\n1.0 3e-4 -2e-5\n".to_vec(),
        b"0.0 2.04e-03 0.0\n0.5 1e-6 -1e-8\n1.0 2e-6 -2e-8\n".to_vec(),
    ])
}

proptest! {
    #[test]
    fn arbitrary_bytes_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        if let Ok((_, _, contents)) = read_bytes(&bytes, false, &mut Notes::default()) {
            assert_sound(&contents);
        }
    }

    #[test]
    fn arbitrary_text_does_no_harm(text in "(([0-9]{1,3}|[-+.,;\t eE\"]|time|freq|re|im|-1|58|\n){0,60})") {
        if let Ok((_, _, contents)) = read_bytes(text.as_bytes(), false, &mut Notes::default()) {
            assert_sound(&contents);
        }
    }

    #[test]
    fn damaged_text_files_do_no_harm(
        mut bytes in small_files(),
        keep in 0.0..1.0_f64,
        hits in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(b"\0\xFF,;.-+eE9\n\" 0nN".to_vec())), 0..6),
    ) {
        bytes.truncate((bytes.len() as f64 * keep) as usize + 1);
        for (at, byte) in hits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok((_, _, contents)) = read_bytes(&bytes, false, &mut Notes::default()) {
            assert_sound(&contents);
        }
    }

    /// Numbers printed with any separator come back exactly.
    #[test]
    fn tables_come_back(
        rows in prop::collection::vec((-1e6..1e6_f64, -1e-6..1e-6_f64), 2..40),
        (separator, decimal) in prop::sample::select(vec![(',', '.'), (';', ','), ('\t', ','), ('\t', '.'), (';', '.')]),
    ) {
        let number = |v: f64| format!("{v}").replace('.', &decimal.to_string());
        let mut text = format!("time_s{separator}fx_n{separator}fy_n\n");
        for (i, (x, y)) in rows.iter().enumerate() {
            let time = number(i as f64 / 128.0);
            text += &format!("{time}{separator}{}{separator}{}\n", number(*x), number(*y));
        }
        let (record, _) = time(&text);
        prop_assert_eq!(record.sample_rate_hz, 128.0);
        let read: Vec<(f64, f64)> = record.channels[0].samples.iter().copied().zip(record.channels[1].samples.iter().copied()).collect();
        prop_assert_eq!(read, rows);
    }
}

/// What recorders and their programs put above and into the same record: forces at 2 kHz.
#[test]
fn records_are_read_as_other_recorders_write_them() {
    let rows = |separator: &str, comma: bool, time: Option<fn(f64) -> String>| -> String {
        let row = |i: usize| {
            let t = i as f64 * 5e-4;
            let values = [0, 1, 2].map(|k| format!("{:.3}", 10.0 * (k + 1) as f64 + 0.5 * i as f64));
            let fields: Vec<String> = time.map(|f| f(t)).into_iter().chain(values).collect();
            let line = fields.join(separator);
            if comma {
                line.replace('.', ",") + "\n"
            } else {
                line + "\n"
            }
        };
        (0..40).map(row).collect()
    };
    let s: fn(f64) -> String = |t| format!("{t:.4}");
    let ms: fn(f64) -> String = |t| format!("{:.1}", 1e3 * t);
    let clock: fn(f64) -> String = |t| format!("2024-03-12T23:59:{:07.4}", 59.0 + t);
    let files: Vec<(&str, String)> = vec![
        (
            "catman",
            "HBM_CATMAN\nDatum: 12.03.2024\n\nZeit  1 - Standardmessrate [s]\tFx [N]\tFy [N]\tFz [N]\n".to_owned()
                + &rows("\t", true, Some(s)),
        ),
        (
            "a line between units and numbers",
            "Zeit  1\tKraft X\tKraft Y\tKraft Z\ns\tN\tN\tN\nSR=2000 Hz\tTyp=DMS\tTyp\tTyp\n".to_owned()
                + &rows("\t", true, Some(s)),
        ),
        (
            "SignalExpress",
            "channel names:\nDev1/ai0 Fx\tDev1/ai1 Fy\tDev1/ai2 Fz\nstart times:\n1\t1\t1 \ndt:\n0.0005\t0.0005\t0.0005\ndata:\n"
                .replace("1\t1\t1 ", "12.03.2024\t12.03.2024\t12.03.2024")
                + &rows("\t", false, None),
        ),
        (
            "Dewesoft",
            "Data1\n\nTime (s),AI 1/Fx (N),AI 2/Fy (N),AI 3/Fz (N)\n".to_owned() + &rows(",", false, Some(s)),
        ),
        ("interval", "dt,0.0005\nFx,Fy,Fz\nN,N,N\n".to_owned() + &rows(",", false, None)),
        (
            "interval in ms",
            "Sample interval [ms];0,5\nFx [N];Fy [N];Fz [N]\n".to_owned() + &rows(";", true, None),
        ),
        ("comments", "# fs = 2 kHz\n# Fx Fy Fz in N\n".to_owned() + &rows(" ", false, None)),
        ("a comment sign", "#time fx fy fz\n".to_owned() + &rows(" ", false, Some(s))),
        (
            "elapsed",
            "Elapsed Time (ms),Force X (N),Force Y (N),Force Z (N)\n".to_owned() + &rows(",", false, Some(ms)),
        ),
        ("Spanish", "Tiempo (s);Fuerza X (N);Fuerza Y (N);Fuerza Z (N)\n".to_owned() + &rows(";", true, Some(s))),
        ("Chinese", "时间(s),X向力(N),Y向力(N),Z向力(N)\n".to_owned() + &rows(",", false, Some(s))),
        ("ISO 80000", "t / s,F_x / N,F_y / N,F_z / N\n".to_owned() + &rows(",", false, Some(s))),
        ("clock", "timestamp,Dyno_Fx,Dyno_Fy,Dyno_Fz\n".to_owned() + &rows(",", false, Some(clock))),
    ];
    for (what, text) in files {
        let (record, warnings) = time(&text);
        assert!(
            (record.sample_rate_hz / 2000.0 - 1.0).abs() < 1e-6,
            "{what}: {}",
            record.sample_rate_hz
        );
        for (k, role) in [ChannelRole::ForceX, ChannelRole::ForceY, ChannelRole::ForceZ]
            .into_iter()
            .enumerate()
        {
            let channel = record
                .channel(role)
                .unwrap_or_else(|| panic!("{what}: no {role:?}: {warnings:?}"));
            assert_eq!(
                (channel.samples[0], channel.samples[39]),
                (10.0 * (k + 1) as f64, 10.0 * (k + 1) as f64 + 19.5),
                "{what}"
            );
        }
    }
}

/// Kyowa's PCD-400A says in the first field of each line above the numbers what the line holds.
#[test]
fn names_of_channels_above_their_units_line() {
    let head = |name: &str| {
        format!(
            "ID No.,PCD-400A,\nSampling Rate(Hz),50,\nCH Name,{name}\nCH No.,CH6,CH8\nRange,5000,5\nOffset,854.5598,-15.97561\n\
             Unit,cm/s2,V\n"
        )
    };
    let rows: String = (0..20)
        .map(|i| format!("{},{},-0.5\n", 0.02 * f64::from(i), 11 + i))
        .collect();
    for (name, names) in [(",", ["CH6", "CH8"]), ("table,hammer", ["table", "hammer"])] {
        let (format, contents, _) = read(head(name) + &rows);
        assert_eq!(format, Format::TimeCsv);
        let record = &contents.times[0];
        let found: Vec<&str> = record.channels.iter().map(|c| c.name.as_str()).collect();
        assert_eq!((found.as_slice(), record.sample_rate_hz), (&names[..], 50.0));
        assert!((record.channels[0].samples[1] - 0.12).abs() < 1e-12);
    }
}

#[test]
fn hints_for_numbers_without_names_speak_of_tap_tests_too() {
    let rows: String = (0..40)
        .map(|i| format!("{}\t{}\n", 0.00025 * f64::from(i), i * i % 13))
        .collect();
    let told = problem(&rows);
    assert!(told.contains("without names"), "{told}");
    let error = read_memory(rows.as_bytes()).unwrap_err();
    let remedy = error.remedy.unwrap_or_default();
    assert!(
        remedy.contains("time_s,force_n,acc_m_per_s2 for a tap test"),
        "{remedy}"
    );
}

#[test]
fn of_several_cycles_the_first_is_read_and_it_is_told() {
    let rows = "0.000\t1.0\t2.0\n0.001\t1.5\t2.0\n0.002\t1.0\t2.5\n0.003\t1.0\t2.0\n";
    let text = format!(
        "File Type:\tDynoWare ASCII Data\nSampling rate [Hz]:\t1000\nCycle No:\t1\nTime\tFx\tFy\ns\tN\tN\n{rows}\nCycle No:\t2\n{rows}"
    );
    let (record, warnings) = time(text);
    assert_eq!(record.len(), 4);
    assert!(
        warnings[0].contains("2 cycles in one file: the first is read"),
        "{warnings:?}"
    );
}
