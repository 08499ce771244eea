use crate::ingest::formats::mat::interpret::*;

fn real(name: &str, size: &[usize], re: Vec<f64>) -> Variable {
    Variable {
        name: name.into(),
        size: size.to_vec(),
        re,
        im: None,
    }
}

fn count(n: usize) -> Vec<f64> {
    (0..n).map(|k| k as f64).collect()
}

#[test]
fn frfs_are_complex_arrays_along_the_frequencies_and_find_their_coherence() {
    let mut h = real("FRF", &[2, 6], count(12));
    h.im = Some(vec![0.5; 12]);
    let mut single = real("H_chan_2_accel", &[6, 1], count(6));
    single.im = Some(vec![1.0; 6]);
    // An analyser's value at 0 Hz says nothing.
    let coherence = real("H_coh_chan_2_accel", &[6, 1], vec![1.3, 0.1, 0.2, 0.3, 0.4, 1.0]);
    let mut notes = Notes::default();
    let all = vec![
        h,
        real("freq", &[1, 6], count(6)),
        single,
        coherence,
        real("PSD_1", &[6, 1], count(6)),
        real("odd", &[3, 1], count(3)),
    ];
    let found = contents(all, &[], &mut Budget::for_file(0), &mut notes).unwrap();
    let names: Vec<&str> = found.frfs.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["FRF(1,:)", "FRF(2,:)", "H_chan_2_accel"]);
    assert_eq!(found.frfs[1].value[2], Complex64::new(5.0, 0.5));
    assert_eq!(found.frfs[0].quantity, None);
    assert_eq!(found.frfs[2].quantity, Some(Quantity::Accelerance));
    assert_eq!(
        found.frfs[2].coherence.as_deref(),
        Some(&[0.0, 0.1, 0.2, 0.3, 0.4, 1.0][..])
    );
    assert_eq!(found.others.len(), 1);
    assert!(notes.into_warnings().iter().any(|w| w.contains("odd")));
}

#[test]
fn an_array_of_coherences_goes_to_the_array_of_frfs_that_is_as_large() {
    let mut frf = real("frf", &[6, 2], count(12));
    frf.im = Some(vec![0.5; 12]);
    let values = [vec![0.9; 6], vec![0.4; 6]].concat();
    let cohe = real("cohe", &[6, 2], values);
    let freq = real("freq", &[6, 1], count(6));
    let (one, warnings) = found(vec![freq.clone(), frf.clone(), cohe.clone()]);
    assert_eq!(one.frfs[0].coherence.as_deref(), Some(&[0.9; 6][..]));
    assert_eq!(one.frfs[1].coherence.as_deref(), Some(&[0.4; 6][..]));
    assert!(!warnings.iter().any(|w| w.contains("cohe")), "{warnings:?}");
    // Of two arrays that are as large, neither.
    let other = Variable {
        name: "other".into(),
        ..frf.clone()
    };
    let (two, warnings) = found(vec![freq, frf, other, cohe]);
    assert!(two.frfs.iter().all(|f| f.coherence.is_none()));
    assert!(
        warnings.iter().any(|w| w.contains("belongs to no FRF")),
        "{warnings:?}"
    );
}

#[test]
fn rates_that_contradict_and_arrays_that_do_not_fit_are_told() {
    let mut spoilt = count(40);
    spoilt[6] = f64::NAN;
    let all = vec![
        real("fs", &[1, 1], vec![5000.0]),
        real("dt", &[1, 1], vec![1e-4]),
        real("Fx", &[40, 1], count(40)),
        real("Fy", &[40, 1], spoilt),
        real("Fz", &[38, 1], count(38)),
        real("tool", &[3, 1], count(3)),
    ];
    let (contents, warnings) = found(all.clone());
    assert_eq!(contents.times[0].sample_rate_hz, 5000.0);
    let told = |part: &str| warnings.iter().any(|w| w.contains(part));
    assert!(
        told("dt: says 10000.0 samples per second, fs says 5000.00: that is taken"),
        "{warnings:?}"
    );
    assert!(told("Fy (value 7 is no number)"), "{warnings:?}");
    let mut with_times = all;
    with_times[1] = real("t", &[40, 1], count(40).iter().map(|k| k * 1e-4).collect());
    let (contents, warnings) = found(with_times);
    assert!((contents.times[0].sample_rate_hz - 1e4).abs() < 1e-6);
    let told = |part: &str| warnings.iter().any(|w| w.contains(part));
    assert!(
        told("fs: says 5000.00 samples per second, the times t say 10000.0"),
        "{warnings:?}"
    );
    assert!(told("Fz (38 values, the signals have 40), tool"), "{warnings:?}");
}

#[test]
fn signals_are_real_arrays_along_the_times_or_at_a_rate() {
    let t: Vec<f64> = count(8).iter().map(|k| f64::from((0.1 * k) as f32)).collect();
    let all = vec![
        real("t", &[8, 1], t),
        real("fs", &[1, 1], vec![10.0]),
        real("fx_n", &[8, 1], count(8)),
    ];
    let found = contents(all.clone(), &[], &mut Budget::for_file(0), &mut Notes::default()).unwrap();
    assert_eq!(found.times.len(), 1);
    assert_eq!(found.times[0].sample_rate_hz, 10.0);
    assert_eq!(
        found.times[0].channels[0].role,
        crate::ingest::ChannelRole::ForceX
    );
    let found = contents(
        all[1..].to_vec(),
        &[],
        &mut Budget::for_file(0),
        &mut Notes::default(),
    )
    .unwrap();
    assert_eq!((found.times[0].sample_rate_hz, found.times[0].len()), (10.0, 8));
    let error = contents(
        all[2..].to_vec(),
        &[],
        &mut Budget::for_file(0),
        &mut Notes::default(),
    )
    .unwrap_err();
    assert!(error.problem.contains("fx_n"), "{error}");
    assert!(contents(Vec::new(), &[], &mut Budget::for_file(0), &mut Notes::default()).is_err());
}

fn found(variables: Vec<Variable>) -> (Contents, Vec<String>) {
    let mut notes = Notes::default();
    let found = contents(variables, &[], &mut Budget::for_file(0), &mut notes).unwrap();
    (found, notes.into_warnings())
}

#[test]
fn arrays_with_their_axis_in_the_first_column() {
    let table =
        |name: &str, columns: &[&[f64]]| real(name, &[columns[0].len(), columns.len()], columns.concat());
    let f = [0.0, 2.0, 4.0, 6.0, 8.0];
    let mut h = table("H1_2", &[&f, &[1.0, 2.0, 3.0, 4.0, 5.0]]);
    h.im = Some([[0.0; 5], [-1.0; 5]].concat());
    let c = table("C1_2", &[&f, &[0.5; 5]]);
    let g = table("G1_1", &[&f, &[9.0; 5]]);
    let x = table(
        "X1",
        &[&[0.0, 0.001, 0.002, 0.003, 0.004], &[1.0, 2.0, 3.0, 4.0, 5.0]],
    );
    let frf = table("frf_tip", &[&f, &[1.0; 5], &[-2.0; 5]]);
    let (found, _) = found(vec![h, c, g, x, frf]);
    assert_eq!(found.frfs.len(), 2);
    assert_eq!(
        (found.frfs[0].name.as_str(), found.frfs[0].frequency_hz.as_slice()),
        ("H1_2", &f[..])
    );
    assert_eq!(found.frfs[0].value[2], Complex64::new(3.0, -1.0));
    assert_eq!(found.frfs[0].coherence.as_deref(), Some(&[0.5; 5][..]));
    assert_eq!(found.frfs[1].value[0], Complex64::new(1.0, -2.0));
    assert_eq!((found.others.len(), found.times.len()), (1, 1));
    approx::assert_relative_eq!(found.times[0].sample_rate_hz, 1000.0, max_relative = 1e-12);
}

#[test]
fn times_before_the_trigger_are_negative() {
    let rows = [[-0.002, -0.001, 0.0, 0.001, 0.002], [0.0, 0.0, 7.0, 3.0, 1.0]].concat();
    let (found, _) = found(vec![real("shock", &[5, 2], rows)]);
    assert_eq!(found.times[0].start_s, -0.002);
    assert_eq!(found.times[0].channels[0].samples, [0.0, 0.0, 7.0, 3.0, 1.0]);
}

#[test]
fn axes_of_start_and_step_of_their_own_or_in_radians() {
    let complex = |name: &str, n: usize| {
        let mut v = real(name, &[n, 1], count(n));
        v.im = Some(vec![-1.0; n]);
        v
    };
    let scalar = |name: &str, value: f64| real(name, &[1, 1], vec![value]);
    let (by_step, _) = found(vec![
        complex("H_3Z_1X", 6),
        scalar("f_start", 5.0),
        scalar("df", 0.5),
    ]);
    assert_eq!(by_step.frfs[0].frequency_hz, [5.0, 5.5, 6.0, 6.5, 7.0, 7.5]);
    assert_eq!(
        by_step.frfs[0].response.map(|d| d.to_string()).as_deref(),
        Some("3Z")
    );
    let structs = vec![
        complex("sig.y_values.values", 5),
        scalar("sig.x_values.start_value", 1.0),
        scalar("sig.x_values.increment", 2.0),
    ];
    assert_eq!(found(structs).0.frfs[0].frequency_hz, [1.0, 3.0, 5.0, 7.0, 9.0]);
    let own = vec![complex("H", 5), real("ax1", &[5, 1], count(5))];
    let (own, told) = found(own);
    assert_eq!(own.frfs[0].frequency_hz, count(5));
    assert!(told.iter().any(|t| t.contains("only rising vector")), "{told:?}");
    let radians = vec![complex("H", 5), real("omega", &[5, 1], count(5))];
    approx::assert_relative_eq!(
        found(radians).0.frfs[0].frequency_hz[4],
        4.0 / (2.0 * std::f64::consts::PI)
    );
    let parts = vec![real("H", &[5, 2], vec![1.0; 10]), real("f", &[5, 1], count(5))];
    assert_eq!(found(parts).0.frfs[0].value[0], Complex64::new(1.0, 1.0));
}

/// SignalCalc lists its channels: what is in g over N is an accelerance, and what it recorded is a force and two accelerations.
#[test]
fn the_list_of_channels_gives_the_units() {
    let axis = |step: f64| (0..8).map(move |k| step * f64::from(k));
    let table = |name: &str, step: f64| {
        let values = axis(step).chain((0..8).map(|_| 2.0)).collect();
        real(name, &[8, 2], values)
    };
    let mut frf = table("H2_5", 1.0);
    frf.im = Some([vec![0.0; 8], vec![1.0; 8]].concat());
    let all = vec![
        real("ChanNum", &[3, 1], vec![2.0, 5.0, 7.0]),
        frf,
        table("X2", 1e-3),
        table("X5", 1e-3),
    ];
    let labels = [Labels {
        name: "Unit".into(),
        rows: ["N", "g", "mm"].map(str::to_string).to_vec(),
    }];
    let read = |labels: &[Labels]| {
        contents(
            all.clone(),
            labels,
            &mut Budget::for_file(0),
            &mut Notes::default(),
        )
        .unwrap()
    };
    let found = read(&labels);
    assert_eq!(found.frfs[0].quantity, Some(Quantity::Accelerance));
    assert!((found.frfs[0].value[3] - Complex64::new(2.0, 1.0) * 9.80665).norm() < 1e-9);
    let samples: Vec<f64> = found.times[0].channels.iter().map(|c| c.samples[0]).collect();
    assert_eq!(samples, [2.0, 2.0 * 9.80665]);
    let unsaid = read(&[]);
    assert_eq!((unsaid.frfs[0].quantity, unsaid.frfs[0].value[3].re), (None, 2.0));
}

/// Beside FRFs a signal that no sensor gives is left out; alone it is an error.
#[test]
fn a_damaged_signal_beside_frfs_is_left_out() {
    let axis: Vec<f64> = (0..8).map(|k| 1e-3 * f64::from(k)).collect();
    let mut values = vec![1.0; 8];
    values[5] = 7e38;
    let signal = real("Z1_4", &[8, 2], [axis, values].concat());
    let mut frf = real("H1_2", &[8, 2], [count(8), vec![2.0; 8]].concat());
    frf.im = Some([vec![0.0; 8], vec![1.0; 8]].concat());
    let (held, told) = found(vec![frf, signal.clone()]);
    assert_eq!((held.frfs.len(), held.times.len()), (1, 0));
    assert!(
        told.iter()
            .any(|w| w.contains("Z1_4: 7e38 in sample 6") && w.contains("left out")),
        "{told:?}"
    );
    let mut notes = Notes::default();
    let error = contents(vec![signal], &[], &mut Budget::for_file(0), &mut notes).unwrap_err();
    assert!(error.problem.contains("Z1_4"), "{error}");
}

/// Names carry units here as in CSV.
#[test]
fn names_of_signals_give_their_units() {
    let (found, _) = found(vec![
        real("t", &[8, 1], (0..8).map(|k| 1e-3 * f64::from(k)).collect()),
        real("force_n", &[8, 1], count(8)),
        real("acc_g", &[8, 1], count(8)),
        real("ACC_(mm_s2)", &[8, 1], count(8)),
        real("x", &[8, 1], count(8)),
    ]);
    let labels: Vec<&str> = found.times[0]
        .channels
        .iter()
        .map(|c| c.file_unit.as_str())
        .collect();
    assert_eq!(labels[..2], ["N", "g"]);
    let last: Vec<f64> = found.times[0].channels.iter().map(|c| c.samples[7]).collect();
    assert!(
        (last[1] - 7.0 * 9.80665).abs() < 1e-9 && (last[2] - 7e-3).abs() < 1e-12,
        "{last:?}"
    );
    let motion = |label: &str| units::parse_named(label).and_then(|u| u.dimension.motion());
    assert_eq!(motion(labels[2]), Some(Quantity::Accelerance), "{labels:?}");
    assert_eq!(labels[3], "");
}
