//! Models in two pieces: which one holds where an axis turns round, and at the start.

use super::*;

/// Deviations for a growing first joint and others for a shrinking one.
#[derive(Clone)]
struct TwoPieces {
    chains: [Chain<f64>; 2],
    last: Option<f64>,
    direction: i8,
}

impl Model for TwoPieces {
    fn advance(&mut self, commands: &[f64], ways: &[bool]) {
        if let Some(last) = self.last.filter(|_| ways[0])
            && (commands[0] - last).abs() > 1e-9
        {
            self.direction = if commands[0] < last { -1 } else { 1 };
        }
        self.last = Some(commands[0]);
    }
    fn chain(&self) -> &Chain<f64> {
        &self.chains[self.piece()]
    }
    fn piece(&self) -> usize {
        usize::from(self.direction < 0)
    }
    fn is_nominal(&self) -> bool {
        false
    }
    fn extrapolates(&self, _: &[f64]) -> bool {
        false
    }
    fn restart(&mut self, first: &[i8]) {
        (self.last, self.direction) = (None, first[0]);
    }
    fn ahead(&self) -> Box<dyn Model + '_> {
        Box::new(self.clone())
    }
    fn keyed(&self) -> &[usize] {
        &[0]
    }
    fn directions(&self) -> Vec<i8> {
        vec![self.direction; 3]
    }
}

#[test]
fn the_step_at_a_reversal_is_told_with_its_line() {
    let (machine, mut model, address) = with_play();
    let text = "G90 G0 X0 Y0 Z0\nG1 @10 F99\n@20\nG4 P1\nZ1\n@15\n@10\n@12\n".replace('@', &address);
    let (out, report) = compensate_with(
        &machine,
        &mut model,
        "part.nc",
        text.as_bytes(),
        &Setup::default(),
        &CompensateOptions::default(),
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let lines: Vec<usize> = report.reversals.first.iter().map(|r| r.line).collect();
    assert_eq!(lines, [6, 8]);
    assert!(report.reversals.first.iter().all(|r| (r.step_m - 12e-6).abs() < 1e-9), "{report:?}");
    assert!((report.largest_reversal_m.value - 12e-6).abs() < 1e-9);
    let out = String::from_utf8_lossy(&out).into_owned();
    let expected = "G90 G0 X0 Y0 Z0\nG1 @10.006 F99\n@20.006\nG4 P1\nZ1\n@14.994\n@9.994\n@12.006\n";
    let plain = out.replace("X0.006", "X0").replace("Y0.006", "Y0");
    assert_eq!(plain, expected.replace('@', &address));
}

/// Play of 12 um on the first joint of `xyz_mill`; its address.
fn with_play() -> (Machine, TwoPieces, String) {
    let machine = machine("xyz_mill");
    let (dyad, along) = machine.joints().next().map(|(j, joint)| (j, joint.axis)).expect("a joint");
    let chain = |by: f64| {
        let mut deviations = vec![Twist::zero(0.0); machine.dyads().len()];
        deviations[dyad].v = along.times(by);
        CalibratedMachine::nominal(machine.clone()).with_deviations(deviations).chain()
    };
    let model = TwoPieces { chains: [chain(-6e-6), chain(6e-6)], last: None, direction: 0 };
    let address = machine.command_joint(0).nc_word().address;
    (machine, model, address)
}

#[test]
fn the_first_direction_of_an_axis_follows_from_where_it_starts_or_from_its_first_known_way() {
    let options = CompensateOptions::default().with_arcs(1e-3);
    // By set-up and program (@: the axis): thousandths that are added to its words in turn, and lines with an unknown way.
    let cases: [(&str, &str, &[i64], &[usize]); 9] = [
        // Forward from the start, and from the other side.
        ("start: {\"@\": 0}", "G0 @10\nG1 @20 F9\n", &[6, 6], &[]),
        ("start: {\"@\": 50}", "G0 @10\nG4 P1\n", &[-6], &[]),
        ("start: {\"@\": 10}", "G0 @10\nG1 @20 F9\n", &[6, 6], &[]),
        // From nowhere: the first way between two known places holds before it.
        ("", "G0 @10\nG1 @10 F9\n@4\n@20\n", &[-6, -6, -6, 6], &[1]),
        ("", "G0 @10\nG4 P1\nG91 G1 @-2 F9\n", &[-6, 0], &[1]),
        // From a place of the machine.
        ("", "G53 G0 @30\nG0 @10\n", &[0, -6], &[]),
        // From a reference point that the set-up knows, or does not.
        ("reference: {\"@\": -50}", "G28 @0\nG0 @10\n", &[0, 6], &[]),
        ("reference: {\"@\": 50}", "G0 @0\nG1 @1 F9\nG28 @0\nG0 @10\n", &[6, 6, 0, -6], &[1]),
        ("", "G0 @0\nG1 @-1 F9\nG28 @0\nG0 @10\n", &[-6, -6, 0, -6], &[1, 4]),
    ];
    for (setup, program, added, unknown) in cases {
        let (machine, mut model, address) = with_play();
        let named = |text: &str| text.replace('@', &address);
        let setup = Setup::parse("setup.ron", &named(&format!("Setup({setup})"))).expect("readable");
        let text = named(program);
        let (out, report) =
            compensate_with(&machine, &mut model, "part.nc", text.as_bytes(), &setup, &options)
                .unwrap_or_else(|e| panic!("{text}: {e}"));
        let out = String::from_utf8_lossy(&out).into_owned();
        let words = |text: &str| -> Vec<f64> {
            let words = text.split_whitespace().filter_map(|w| w.strip_prefix(address.as_str()));
            words.map(|w| w.parse().expect("a number")).collect()
        };
        let by: Vec<i64> = (words(&out).iter().zip(words(&text)))
            .map(|(after, before)| ((after - before) * 1e3).round() as i64)
            .collect();
        assert_eq!(by, added, "{text}{out}");
        let lines: Vec<usize> = report.unknown_ways.first.iter().map(|way| way.line).collect();
        assert_eq!(lines, unknown, "{text}");
    }
}
