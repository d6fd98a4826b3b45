//! Laws over every machine that ships in `machines/`, and over machines made at random.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use kincal::lie::Vec3;
use kincal::machine::{Dyad, FileUnits, Joint, JointKind, MassPoint, NcWord, Placement, SHIPPED, Tolerance};
use kincal::units::{Quantity, Unit};
use kincal::{Chain, Machine};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use proptest::prelude::*;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every shipped machine with its path, in the order of names.
fn shipped() -> Vec<(PathBuf, Machine)> {
    let folder = std::fs::read_dir(root().join("machines")).expect("machines/ is part of the project");
    let mut paths: Vec<PathBuf> = folder.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.sort();
    paths.retain(|path| path.extension().is_some_and(|e| e == "ron"));
    assert!(paths.len() >= 20, "only {} machines", paths.len());
    let open = |path: PathBuf| {
        let machine = Machine::open(&path).unwrap_or_else(|e| panic!("{e}: {}", e.mend()));
        (path, machine)
    };
    paths.into_iter().map(open).collect()
}

#[test]
fn every_machine_of_the_folder_comes_with_the_crate_and_is_named_like_its_file() {
    let folder = shipped();
    assert_eq!(SHIPPED.len(), folder.len());
    for (name, text) in SHIPPED {
        assert_eq!(Machine::parse(name, text).expect("a machine").name(), name);
        assert!(folder.iter().any(|(path, _)| path.file_stem().is_some_and(|stem| stem == name)), "{name}");
    }
}

/// Commands inside the limits, m or rad; `k` chooses one of many fixed poses.
fn pose_inside(machine: &Machine, k: usize) -> Vec<f64> {
    let one = |c: usize| {
        let part = ((7 * c + 3 * k + 2) % 11) as f64 / 11.0 + 0.04;
        match machine.travel(c) {
            (from, to) if from.is_finite() && to.is_finite() => from + part * (to - from),
            _ => part - 0.5,
        }
    };
    (0..machine.commands().len()).map(one).collect()
}

/// `w_from_t` as anyone would write it who has nalgebra and the declaration, one product after the other.
fn w_from_t_by_isometries(machine: &Machine, q: &[f64]) -> Isometry3<f64> {
    let mut ends = [Isometry3::identity(), Isometry3::identity()];
    for (j, dyad) in machine.dyads().iter().enumerate() {
        let end = &mut ends[usize::from(j >= machine.workpiece_count())];
        let [x, y, z] = dyad.placement.at.0;
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(dyad.placement.rotation.0));
        *end *= Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        let Some(joint) = &dyad.joint else { continue };
        let index = |name: &str| machine.commands().iter().position(|c| c == name).expect("a command");
        let displacement: f64 = match &joint.follows {
            None => q[index(&joint.name)],
            Some(leaders) => leaders.iter().map(|(name, factor)| factor * q[index(name)]).sum(),
        };
        let axis = Vector3::from(joint.axis.0);
        *end *= match joint.kind {
            JointKind::Prismatic => {
                Isometry3::translation(axis.x * displacement, axis.y * displacement, axis.z * displacement)
            }
            JointKind::Revolute => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&UnitVector3::new_normalize(axis), displacement),
            ),
        };
    }
    ends[0].inverse() * ends[1]
}

#[test]
fn every_machine_is_named_as_its_file_and_says_what_it_is() {
    for (path, machine) in shipped() {
        assert_eq!(path.file_stem().and_then(|s| s.to_str()), Some(machine.name()));
        assert!(machine.about().is_some_and(|about| about.len() > 10), "{}", path.display());
    }
}

#[test]
fn every_machine_written_and_read_again_is_the_same_machine_and_the_same_text() {
    for (path, machine) in shipped() {
        let text = machine.to_ron();
        let again = Machine::parse(&path, &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(machine, again, "{text}");
        assert_eq!(text, again.to_ron());
    }
}

#[test]
fn line_ends_and_byte_order_marks_of_other_systems_change_nothing() {
    for (path, machine) in shipped() {
        let text = std::fs::read_to_string(&path).expect("a readable machine");
        let foreign = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        assert_eq!(Machine::parse(&path, &foreign).expect("the same machine"), machine);
    }
}

#[test]
fn every_machine_moves_as_a_product_of_isometries_does() {
    for (path, machine) in shipped() {
        let chain = Chain::nominal(&machine);
        for k in 0..11 {
            let q = pose_inside(&machine, k);
            let ours = chain.w_from_t(&q);
            let theirs = w_from_t_by_isometries(&machine, &q).to_homogeneous();
            for i in 0..3 {
                for j in 0..3 {
                    let difference = (ours.rotation.0[i][j] - theirs[(i, j)]).abs();
                    assert!(difference < 1e-12, "{}: {difference}", path.display());
                }
                let difference = (ours.translation.0[i] - theirs[(i, 3)]).abs();
                assert!(difference < 1e-12, "{}: {difference} m", path.display());
            }
        }
    }
}

#[test]
fn home_of_the_five_axis_machines_is_closed() {
    for (_, machine) in shipped() {
        let closed =
            ["bc_table_tilting", "bc_head_table", "ac_head_head", "bc_nutating_table", "bc_head_head"]
                .into_iter()
                .chain(["bc_head_head_nutating", "four_axis_horizontal", "xyz_mill"]);
        let home = Chain::nominal(&machine).w_from_t(&vec![0.0; machine.commands().len()]).translation;
        if closed.into_iter().any(|name| name == machine.name()) {
            // The tilting BC table bears a rounded 0.02 mm in x.
            assert!(home.norm() < 2.1e-5, "{}: {:?}", machine.name(), home);
        } else if machine.name() == "ac_table_tilting" {
            assert!((home.0[2].abs() - 0.99e-3).abs() < 1e-9, "{home:?}");
        }
    }
}

#[test]
fn model_outputs_at_fixed_poses() {
    let rounded = |value: f64| if (value * 1e6).round() == 0.0 { 0.0 } else { (value * 1e6).round() / 1e6 };
    let list = |values: &[f64]| values.iter().map(|v| format!("{v:.6}")).collect::<Vec<_>>().join(", ");
    let mut lines = Vec::new();
    for (_, machine) in shipped() {
        lines.push(machine.name().to_string());
        let chain = Chain::nominal(&machine);
        for k in 0..3 {
            let inside = |c: usize, q: f64| match machine.command_joint(c).kind {
                JointKind::Prismatic => (q * 1e3).round() / 1e3,
                JointKind::Revolute => q.to_degrees().round().to_radians(),
            };
            let q: Vec<f64> =
                pose_inside(&machine, k).into_iter().enumerate().map(|(c, q)| inside(c, q)).collect();
            let pose = chain.w_from_t(&q);
            let commands: Vec<String> = (q.iter().enumerate())
                .map(|(c, q)| match machine.command_joint(c).kind {
                    JointKind::Prismatic => format!("{} {:.0} mm", machine.commands()[c], q * 1e3),
                    JointKind::Revolute => format!("{} {:.0} deg", machine.commands()[c], q.to_degrees()),
                })
                .collect();
            let p = pose.translation.0.map(|c| rounded(c * 1e3));
            let r = pose.rotation_vector().0.map(|c| rounded(c.to_degrees()));
            lines.push(format!("  {}", commands.join(", ")));
            lines.push(format!("    p [mm] {}   r [deg] {}", list(&p), list(&r)));
        }
    }
    insta::assert_snapshot!(lines.join("\n"));
}

fn units() -> impl Strategy<Value = FileUnits> {
    let named = |symbol| Unit::named(symbol).expect("a unit");
    let pick = move |symbols: &[&'static str]| {
        proptest::sample::select(symbols.iter().map(|s| named(s)).collect::<Vec<_>>())
    };
    (pick(&["m", "mm", "um", "nm", "in"]), pick(&["rad", "mrad", "urad", "deg", "arcsec"]))
        .prop_map(|(length, angle)| FileUnits { length, angle })
}

fn vector(largest: f64) -> impl Strategy<Value = Vec3<f64>> {
    proptest::array::uniform3(prop_oneof![Just(0.0), -largest..largest]).prop_map(Vec3)
}

fn axis() -> impl Strategy<Value = Vec3<f64>> {
    let words = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]].map(Vec3);
    let slanted = vector(1.0).prop_filter("not near zero", |v| v.norm() > 0.1);
    prop_oneof![
        proptest::sample::select(words.to_vec()),
        slanted.prop_map(|v| Vec3(v.0.map(|c| c / v.norm())))
    ]
}

fn tolerance() -> impl Strategy<Value = Tolerance> {
    (1e-6..1e-2, 1e-6..1e-2).prop_map(|(translation, rotation)| Tolerance { translation, rotation })
}

type JointParts = (JointKind, Vec3<f64>, Option<(f64, f64)>, Option<i8>, Option<f64>);

fn joint_parts() -> impl Strategy<Value = JointParts> {
    let kind = prop_oneof![Just(JointKind::Prismatic), Just(JointKind::Revolute)];
    let travel = proptest::option::of((-6.0..0.0, 0.001..6.0));
    let sign = proptest::option::of(prop_oneof![Just(1i8), Just(-1i8)]);
    (kind, axis(), travel, sign, proptest::option::of(-2.0..2.0))
}

fn dyads() -> impl Strategy<Value = Vec<(Dyad, Option<JointParts>)>> {
    let mass = proptest::option::of((0.0..500.0, vector(2.0)))
        .prop_map(|m| m.map(|(mass, centre)| MassPoint { mass, centre }));
    let dyad = (vector(2.0), vector(1.5), mass, proptest::option::of(tolerance())).prop_map(
        |(at, rotation, mass, tolerance)| {
            let mut dyad = Dyad::new("").placed(Placement { at, rotation });
            (dyad.mass, dyad.tolerance) = (mass, tolerance);
            dyad
        },
    );
    proptest::collection::vec((dyad, proptest::option::of(joint_parts())), 1..7)
}

/// Any machine that the declaration allows: the first joint is always commanded, later ones may follow it.
fn machines() -> impl Strategy<Value = Machine> {
    let file = (units(), vector(1.0), proptest::option::of(tolerance()), proptest::option::of("[ -~]{0,40}"));
    (file, dyads(), dyads()).prop_map(|((units, gravity, tolerance, about), workpiece, tool)| {
        let mut leader: Option<String> = None;
        let mut name = |list: Vec<(Dyad, Option<JointParts>)>, letter: &str, last: &str| {
            let mut named = Vec::new();
            for (i, (mut dyad, parts)) in list.into_iter().enumerate() {
                dyad.frame = format!("{letter}{i}");
                let parts = parts.or((letter == "f" && i == 0).then_some((
                    JointKind::Revolute,
                    Vec3([0.0, 0.0, 1.0]),
                    None,
                    None,
                    None,
                )));
                dyad.joint = parts.map(|(kind, axis, travel, sign, follows)| {
                    let joint_name = if i % 2 == 0 { dyad.frame.clone() } else { format!("j{letter}{i}") };
                    let follows = (leader.as_ref())
                        .zip(follows)
                        .map(|(leader, f)| BTreeMap::from([(leader.clone(), f)]));
                    leader.get_or_insert_with(|| joint_name.clone());
                    let nc = sign.map(|sign| NcWord { address: format!("A{i}"), sign });
                    let mut joint = Joint::new(joint_name, kind, axis);
                    (joint.travel, joint.follows, joint.nc) = (travel, follows, nc);
                    joint
                });
                named.push(dyad);
            }
            named.push(Dyad::new(last));
            named
        };
        let tool = name(tool, "f", "t");
        let workpiece = name(workpiece, "e", "w");
        let mut machine =
            Machine::new("random", units, workpiece, tool).expect("a valid machine").with_about(about);
        if gravity.norm() > 0.1 {
            machine = machine.with_gravity(gravity).expect("a direction");
        }
        match tolerance {
            Some(tolerance) => machine.with_tolerance(tolerance).expect("a tolerance"),
            None => machine,
        }
    })
}

/// Equal up to rounding in the last places; that is what a number loses whose unit has no exact double for it.
fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 4.0 * f64::EPSILON * a.abs().max(b.abs())
}

fn near_vec(a: Vec3<f64>, b: Vec3<f64>) -> bool {
    a.0.into_iter().zip(b.0).all(|(a, b)| near(a, b))
}

fn assert_near(a: &Machine, b: &Machine) {
    assert_eq!((a.name(), a.about(), a.units()), (b.name(), b.about(), b.units()));
    assert_eq!(a.commands(), b.commands());
    assert_eq!(a.workpiece_count(), b.workpiece_count());
    assert!(near_vec(a.gravity_b(), b.gravity_b()));
    let near_tolerance =
        |a: Tolerance, b: Tolerance| near(a.translation, b.translation) && near(a.rotation, b.rotation);
    assert!(near_tolerance(a.default_tolerance(), b.default_tolerance()));
    for (j, (x, y)) in a.dyads().iter().zip(b.dyads()).enumerate() {
        assert_eq!(x.frame, y.frame);
        assert!(near_vec(x.placement.at, y.placement.at), "{x:?} {y:?}");
        assert!(near_vec(x.placement.rotation, y.placement.rotation), "{x:?} {y:?}");
        assert_eq!(x.tolerance.is_some(), y.tolerance.is_some());
        assert!(near_tolerance(a.tolerance(j), b.tolerance(j)));
        assert_eq!(x.mass.is_some(), y.mass.is_some());
        if let (Some(x), Some(y)) = (x.mass, y.mass) {
            assert!(x.mass == y.mass && near_vec(x.centre, y.centre));
        }
        assert_eq!(x.joint.is_some(), y.joint.is_some());
        if let (Some(x), Some(y)) = (&x.joint, &y.joint) {
            assert_eq!((&x.name, x.kind, &x.follows, &x.nc), (&y.name, y.kind, &y.follows, &y.nc));
            assert!(near_vec(x.axis, y.axis), "{x:?} {y:?}");
            let limits = |joint: &Joint| joint.travel.unwrap_or((0.0, 0.0));
            assert!(near(limits(x).0, limits(y).0) && near(limits(x).1, limits(y).1));
        }
        assert_eq!(a.drive(j), b.drive(j));
    }
}

/// The same cases on every run.
fn fixed_cases() -> ProptestConfig {
    ProptestConfig {
        cases: 512,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_260_101),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(fixed_cases())]

    #[test]
    fn random_machines_survive_the_file(machine in machines()) {
        let text = machine.to_ron();
        let again = Machine::parse("random.ron", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_near(&machine, &again);
        // What came from a file goes back into one unchanged.
        let third = Machine::parse("again.ron", &again.to_ron()).expect("what we wrote");
        prop_assert_eq!(&again, &third);
        prop_assert_eq!(again.to_ron(), third.to_ron());
    }

    #[test]
    fn every_quantity_survives_its_unit(value in -1e4..1e4f64, index in 0usize..10) {
        let named: Vec<Unit> = kincal::units::UNITS
            .into_iter()
            .filter(|u| matches!(u.quantity, Quantity::Length | Quantity::Angle))
            .collect();
        let unit = named[index];
        prop_assert!(near(unit.to_si(unit.write_si(value)), value));
        // A number read from a file is written as the same number in SI.
        let read = unit.to_si(value);
        prop_assert_eq!(unit.to_si(unit.write_si(read)).to_bits(), read.to_bits());
    }
}

/// The `ron` blocks of a page.
fn ron_blocks(page: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    for part in page.split("```ron\n").skip(1) {
        blocks.push(part.split("```").next().expect("a block ends").to_string());
    }
    blocks
}

#[test]
fn every_example_of_the_page_on_machines_is_a_machine() {
    let page = std::fs::read_to_string(root().join("docs/machines.md")).expect("the page");
    let blocks = ron_blocks(&page);
    assert!(blocks.len() >= 4);
    for block in blocks {
        Machine::parse("docs/machines.md", &block).unwrap_or_else(|e| panic!("{e}: {}\n{block}", e.mend()));
    }
}

#[test]
fn the_page_on_machines_lists_every_machine_that_ships() {
    let page = std::fs::read_to_string(root().join("docs/machines.md")).expect("the page");
    for (_, machine) in shipped() {
        assert!(page.contains(&format!("`{}`", machine.name())), "{} is not listed", machine.name());
    }
}

/// One recording of positions: commands, m or rad, and measured points, m.
fn positions(machine: &Machine, file: &Path) -> Vec<(Vec<f64>, Vector3<f64>)> {
    let text = std::fs::read_to_string(file).expect("a readable recording");
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<(&str, &str)> = (rows.next().expect("a header").split(','))
        .map(|column| column.trim_end_matches(']').split_once('[').expect("a unit in brackets"))
        .collect();
    let cell = |row: &str, name: &str| -> Option<f64> {
        let column = header.iter().position(|(n, _)| *n == name).expect("a column");
        let unit = Unit::named(header[column].1).expect("a unit");
        Some(unit.to_si(row.split(',').nth(column)?.trim().parse().ok().filter(|v: &f64| v.is_finite())?))
    };
    rows.filter_map(|row| {
        let q = machine.commands().iter().map(|c| cell(row, c)).collect::<Option<Vec<f64>>>()?;
        Some((q, Vector3::new(cell(row, "px")?, cell(row, "py")?, cell(row, "pz")?)))
    })
    .collect()
}

/// RMS of what is left after the instrument's frame and, unless given, the marker on the tool have been found, m.
fn aligned_rms(machine: &Machine, file: &Path, marker: Option<Vector3<f64>>) -> f64 {
    let chain = Chain::nominal(machine);
    let samples: Vec<_> = positions(machine, file)
        .into_iter()
        .map(|(q, measured)| (nalgebra::Isometry3::from(chain.w_from_t(&q)), measured))
        .collect();
    let n = samples.len() as f64;
    let mut point = marker.unwrap_or_default();
    let mut rms = f64::INFINITY;
    for _ in 0..if marker.is_some() { 1 } else { 400 } {
        // Rigid alignment of model points with measured ones.
        let model: Vec<_> = samples.iter().map(|(pose, _)| pose * nalgebra::Point3::from(point)).collect();
        let centre = model.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
        let middle = samples.iter().map(|(_, m)| m).sum::<Vector3<f64>>() / n;
        let pairs = model.iter().zip(&samples);
        let spread: nalgebra::Matrix3<f64> =
            pairs.map(|(p, (_, m))| (m - middle) * (p.coords - centre).transpose()).sum();
        let svd = spread.svd(true, true);
        let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
        let mut flip = nalgebra::Matrix3::identity();
        flip[(2, 2)] = (u * v_t).determinant().signum();
        let turn = u * flip * v_t;
        let shift = middle - turn * centre;
        let residual = |(p, (_, m)): (&nalgebra::Point3<f64>, &(Isometry3<f64>, Vector3<f64>))| {
            (turn * p.coords + shift - m).norm_squared()
        };
        rms = (model.iter().zip(&samples).map(residual).sum::<f64>() / n).sqrt();
        if marker.is_none() {
            // The marker: a mean, since each rotation is orthogonal.
            let seen = |(pose, m): &(Isometry3<f64>, Vector3<f64>)| {
                pose.rotation.inverse() * (turn.transpose() * (m - shift) - pose.translation.vector)
            };
            point = samples.iter().map(seen).sum::<Vector3<f64>>() / n;
        }
    }
    rms
}

mod data_sets {
    use super::*;

    fn csv_files(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a readable folder") {
            let path = entry.expect("a readable folder").path();
            if path.is_dir() {
                csv_files(&path, found);
            } else if path.extension().is_some_and(|e| e == "csv") {
                found.push(path);
            }
        }
    }

    #[test]
    #[ignore = "needs the data sets, see tests/real"]
    fn real_recordings_name_shipped_machines_and_stay_inside_their_travel() {
        let folder = crate::common::data("recordings");
        let machines: BTreeMap<String, Machine> =
            shipped().into_iter().map(|(_, m)| (m.name().to_string(), m)).collect();
        let mut files = Vec::new();
        csv_files(&folder, &mut files);
        assert!(!files.is_empty());
        let mut without = BTreeSet::new();
        for file in files {
            let text = std::fs::read_to_string(&file).expect("a readable recording");
            let keyed = text.lines().find_map(|line| line.strip_prefix("# machine:"));
            let named = keyed.expect("a recording names its machine").trim();
            let Some(machine) = machines.get(named) else {
                without.insert(named.to_string());
                continue;
            };
            let mut rows = text.lines().filter(|line| !line.starts_with('#'));
            let header: Vec<(&str, &str)> = (rows.next().expect("a header").split(','))
                .map(|column| column.trim_end_matches(']').split_once('[').expect("a unit in brackets"))
                .collect();
            for (c, command) in machine.commands().iter().enumerate() {
                let column = header.iter().position(|(name, _)| name == command);
                let column = column.unwrap_or_else(|| panic!("{}: no column {command}", file.display()));
                let unit = Unit::named(header[column].1).expect("a unit");
                let (from, to) = machine.travel(c);
                for row in rows.clone() {
                    let Ok(value) = row.split(',').nth(column).expect("a full row").trim().parse() else {
                        continue;
                    };
                    let value = unit.to_si(value);
                    assert!(from <= value && value <= to, "{}: {command} = {value}", file.display());
                }
            }
        }
        // Recordings of a machine that nobody has written a file for are left out: it is named here, so that no other is.
        assert_eq!(without.into_iter().collect::<Vec<_>>(), ["dvrk_psm"]);
    }

    #[test]
    #[ignore = "needs the data sets, see tests/real"]
    fn real_recordings_fit_their_machines_once_frames_are_aligned() {
        let folder = crate::common::data("recordings");
        let prism = Vector3::new(1.01828e-3, -100.91023e-3, 335.65636e-3);
        // Machine, recording, marker on the tool where it is known, most that may be left, m.
        let cases = [
            ("fanuc_r2000ic_165f", "fanuc_r2000ic/mark_A.csv", None, 0.7e-3),
            ("fanuc_r2000ic_165f", "fanuc_r2000ic/mark_B.csv", None, 0.7e-3),
            ("fanuc_r2000ic_165f", "fanuc_r2000ic/mark_C.csv", None, 0.7e-3),
            ("dlr_justin_right", "dlr_justin/right.csv", None, 19e-3),
            ("dlr_justin_left", "dlr_justin/left.csv", None, 19e-3),
            ("franka_panda", "mukca/panda_2/front_center.csv", None, 8e-3),
            ("kuka_iiwa14", "mukca/kuka_14/front.csv", None, 1e-3),
            ("kinova_gen3_lite", "mukca/dinova_2/left.csv", None, 6e-3),
            ("hilti_jaibot", "hilti_jaibot/flat.csv", Some(prism), 10e-3),
            ("hilti_jaibot", "hilti_jaibot/seesaw.csv", Some(prism), 11e-3),
        ];
        for (name, file, marker, most) in cases {
            let machine =
                Machine::open(root().join(format!("machines/{name}.ron"))).expect("a shipped machine");
            let rms = aligned_rms(&machine, &folder.join(file), marker);
            println!("{file}: {:.3} mm", rms * 1e3);
            assert!(rms < most, "{file}: {:.3} mm are left", rms * 1e3);
        }
    }
}
