//! What is exported moves as the calibrated machine does.

use std::path::{Path, PathBuf};

use kincal::export::{BaseFile, Format, Options, export};
use kincal::import::{Ends, read};
use kincal::lie::{Pose, Twist};
use kincal::{CalibratedMachine, Chain, Machine};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Every machine that comes with the program, with deviations of some tenths of a millimetre and a milliradian.
fn machines() -> Vec<CalibratedMachine> {
    let mut rng = StdRng::seed_from_u64(7);
    let mut names: Vec<PathBuf> = std::fs::read_dir(folder("machines"))
        .expect("a folder")
        .map(|e| e.expect("readable").path())
        .collect();
    names.sort();
    let calibrated = |path: PathBuf| {
        let machine = Machine::open(path).expect("a machine");
        let deviations = deviations(machine.dyads().len(), &mut rng);
        CalibratedMachine::nominal(machine).with_deviations(deviations)
    };
    names.into_iter().map(calibrated).collect()
}

fn deviations(count: usize, rng: &mut StdRng) -> Vec<Twist<f64>> {
    (0..count).map(|_| Twist::from_array(std::array::from_fn(|_| rng.random_range(-1e-3..1e-3)))).collect()
}

fn commands(machine: &Machine, rng: &mut StdRng) -> Vec<f64> {
    machine.commands().iter().map(|_| rng.random_range(-2.0..2.0)).collect()
}

/// Largest difference of two poses, m and of rotation matrices.
fn gap(a: Pose<f64>, b: Pose<f64>) -> f64 {
    let rotation = a.rotation.0.iter().flatten().zip(b.rotation.0.iter().flatten());
    rotation.chain(a.translation.0.iter().zip(&b.translation.0)).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

#[test]
fn a_urdf_file_read_back_is_the_same_machine() {
    let mut rng = StdRng::seed_from_u64(3);
    let mut compared = 0;
    for calibrated in machines() {
        let machine = calibrated.machine();
        let Ok(exported) = export(&calibrated, Format::Urdf, &Options::default()) else {
            assert!(
                machine.name().contains("justin") || machine.name().contains("jaibot"),
                "{}",
                machine.name()
            );
            continue;
        };
        let ends = Ends { base: Some("w".into()), tip: Some("t".into()) };
        let back = read("back.urdf", &exported.text, &ends).expect(machine.name()).machine;
        assert_eq!(back.commands(), machine.commands());
        for _ in 0..20 {
            let q = commands(machine, &mut rng);
            let gap = gap(calibrated.chain().w_from_t(&q), Chain::nominal(&back).w_from_t(&q));
            assert!(gap < 1e-12, "{}: {gap:e}", machine.name());
        }
        compared += 1;
    }
    assert!(compared > 15, "{compared}");
}

#[test]
fn a_base_file_keeps_every_byte_but_its_origins() {
    let path = folder("tests/urdf/arm.urdf");
    let ends = Ends { base: None, tip: Some("finger".into()) };
    let text = std::fs::read_to_string(&path).expect("a text");
    let mut rng = StdRng::seed_from_u64(5);
    let mut before = String::new();
    // As it stands; with what stands before the first element, a prefix that nobody declares, and origins that are not there.
    for round in 0..3 {
        let text = match round {
            0 => text.clone(),
            1 => format!(
                "\u{feff}\n\n{}",
                text.replace("<link name=\"floor\"/>", "<link name=\"floor\"><x:y z:a=\"1\"/></link>")
            ),
            _ => text.replace("<origin xyz=\"0.3 0 0.05\"", "<origin").replace(" rpy=\"0.1 0.2 0.3\"", ""),
        };
        assert_ne!(text, before);
        before.clone_from(&text);
        let machine = read(&path, &text, &ends).expect("sound").machine;
        let deviations = deviations(machine.dyads().len(), &mut rng);
        let calibrated = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
        let mut options = Options::default();
        options.base_file = Some(BaseFile { file: path.clone(), text: text.clone(), ends: ends.clone() });
        let exported = export(&calibrated, Format::Urdf, &options).expect("sound");
        let back = read(&path, &exported.text, &ends).expect("sound").machine;
        for _ in 0..20 {
            let q = commands(&machine, &mut rng);
            let gap = gap(calibrated.chain().w_from_t(&q), Chain::nominal(&back).w_from_t(&q));
            assert!(gap < 1e-12, "{gap:e}");
        }
        // Outside of quotes of origins nothing has changed.
        let bare = |text: &str| -> String {
            let mut parts = text.split("<origin");
            let first = parts.next().unwrap_or_default().to_string();
            parts.fold(first, |out, part| out + part.split_once('>').map_or("", |(_, rest)| rest))
        };
        assert_eq!(bare(&exported.text), bare(&text));
        // Without deviations every byte is as it was.
        let nominal = export(&CalibratedMachine::nominal(machine), Format::Urdf, &options).expect("sound");
        assert_eq!(nominal.text, text);
    }
}
