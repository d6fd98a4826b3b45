//! Calibrations that are nonsense are told, the mistake is named, and nothing is said of sound recordings.

use crate::common::planted::{PLANTED, drawn, far, is_named, said_of, sound};
use crate::common::{machine, machines};
use kincal::sensor::Sensor;

#[test]
fn planted_mistakes_are_named() {
    // One of each kind: a sign, columns swapped, units, a zero, the measured turn, the order of the rows.
    let one_of_each = [0, 3, 6, 7, 13, 15];
    for planted in one_of_each.map(|i| &PLANTED[i]) {
        let said = said_of(planted);
        assert!(is_named(planted, &said), "{}, {}: {said:?}", planted.machine, planted.what);
    }
}

#[test]
#[ignore = "long: some twenty recordings, each read with every mistake undone; the table of docs/reliability.md is the same"]
fn nineteen_of_twenty_planted_mistakes_are_named() {
    let missed: Vec<&str> =
        PLANTED.iter().filter(|planted| !is_named(planted, &said_of(planted))).map(|p| p.what).collect();
    assert!(20 * missed.len() <= PLANTED.len(), "{missed:?}");
}

#[test]
fn nothing_is_said_of_sound_recordings() {
    for (draw, name) in ["ac_table_tilting", "kuka_iiwa14", "scara"].into_iter().enumerate() {
        let (said, excess) = sound(name, draw as u64);
        assert!(said.is_none() && excess < 0.5, "{name}: {excess} {said:?}");
    }
}

#[test]
#[ignore = "long: 200 recordings"]
fn nothing_is_said_of_two_hundred_sound_recordings() {
    let names: Vec<String> = machines().into_iter().map(|(name, _)| name).collect();
    for draw in 0..200 {
        let name = &names[draw % names.len()];
        let (said, excess) = sound(name, draw as u64);
        assert!(said.is_none() && excess < 0.5, "{name}, draw {draw}: {excess} {said:?}");
    }
}

#[test]
fn deviations_far_beyond_the_tolerances_are_found_and_told() {
    let machine = machine("ac_table_tilting");
    let (left, warnings) = far(&machine, Sensor::Position, 30.0);
    assert!(left < 3e-6, "{left} m are left");
    assert!(
        warnings.iter().any(|w| w.contains("tolerances from where the machine file has it")),
        "{warnings:?}"
    );
}

#[test]
fn machines_that_are_drawn_are_found_from_afar() {
    let missed: Vec<String> = (0..12).filter_map(|draw| drawn(draw).err()).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
#[ignore = "long: every machine in positions and poses, from 1 to 30 tolerances"]
fn the_noise_is_reached_from_afar_on_every_machine() {
    for (name, machine) in machines() {
        for sensor in [Sensor::Position, Sensor::Pose] {
            for size in [1.0, 3.0, 10.0, 30.0] {
                let (left, _) = far(&machine, sensor.clone(), size);
                assert!(left < 3e-6, "{name}, {sensor:?}, {size} tolerances: {left} m are left");
            }
        }
    }
}
