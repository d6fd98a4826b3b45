//! Solvers (section 5), and local against global (section 6).

use kincal::rivals::{Form, Rival, Scheme, Step};
use kincal::simulate::random_commands;
use kincal::{CalibratedMachine, Chain};

use super::reference::*;

#[test]
fn the_preset_errors_are_those_of_the_facts() {
    let machine = machine();
    let qs = table_7_path(&machine, &full_turn(100));
    let truth = true_machine(&machine, Preset::ALL);
    let (chain, declared) = (truth.chain(), Chain::nominal(&machine));
    let pairs = qs.iter().map(|q| (chain.w_from_t(q).translation, declared.w_from_t(q).translation));
    let (mut dp, mut variation) = (0.0, 0.0f64);
    for (p, q) in pairs {
        dp += (p - q).norm() / 100.0;
        variation = variation.max((p.norm() - q.norm()).abs());
    }
    println!(
        "start: dp {:.2} um (facts: 34.7), largest variation {:.2} um (facts: 33.6)",
        dp * 1e6,
        variation * 1e6
    );
    close("dp", dp * 1e6, 34.7, 0.02);
    close("variation", variation * 1e6, 33.6, 0.02);
}

#[test]
fn plain_normal_equations_fail_at_once_and_so_they_do_without_the_zero_columns() {
    let machine = machine();
    let qs = table_7_path(&machine, &full_turn(100));
    let truth = true_machine(&machine, Preset::ALL);
    for form in [Form::Local, Form::Factors] {
        let recordings = [record(&truth, &qs, Kind::Distance, 1e-5, 0)];
        let error =
            Rival::Scheme(Scheme { form, step: Step::GaussNewton, steps: 30 }).fit(&machine, &recordings);
        let error = error.expect_err("singular").to_string();
        println!("{form:?}: {error}");
        assert!(error.contains("singular"), "{error}");
    }
    let rows = factor_rows(&machine, &qs, &from_centre(ORIGIN), &[ORIGIN]);
    let without = rows.columns(0, 39).into_owned();
    let values = values(&without);
    assert!(values[38] < 1e-14 * values[0], "{:?}", values);
}

#[test]
fn solvers_end_where_the_facts_say() {
    let machine = machine();
    let qs = table_7_path(&machine, &full_turn(100));
    let truth = true_machine(&machine, Preset::ALL);
    println!("noise U[0, 10 um], medians of {SEEDS} seeds; facts in brackets");
    for (name, step, [dp_1, dp_30, largest]) in [
        ("tau 1e-6", Step::Damped { tau: 1e-6 }, [48.0, 177.0, 490.0]),
        ("tau 1e-5", Step::Damped { tau: 1e-5 }, [24.5, 97.0, 220.0]),
        ("tau 1e-4", Step::Damped { tau: 1e-4 }, [20.2, 35.0, 59.0]),
        ("tau 1e-3", Step::Damped { tau: 1e-3 }, [22.8, 22.5, 26.0]),
        ("tau 1e-2", Step::Damped { tau: 1e-2 }, [26.9, 20.5, 17.0]),
        ("mu 1e-4", Step::DampedBy { mu: 1e-4 }, [42.0, 128.0, 380.0]),
        ("mu 1", Step::DampedBy { mu: 1.0 }, [27.0, 21.2, 16.0]),
        ("SVD 1e-3", Step::Truncated { cut: 1e-3, unit_m: 1.0 }, [23.1, 23.2, 22.0]),
        ("SVD 1e-3, 0.1 m", Step::Truncated { cut: 1e-3, unit_m: 0.1 }, [29.5, 29.5, 94.0]),
    ] {
        let one = runs(&truth, &qs, 1e-5, Kind::Distance, scheme(Form::Factors, step, 1));
        let all = runs(&truth, &qs, 1e-5, Kind::Distance, scheme(Form::Factors, step, 30));
        let [first, last, size] =
            [median_of(&one, 1), median_of(&all, 1), median_of(&all, 3)].map(|x| x * 1e6);
        let radial = median_of(&all, 0) * 1e6;
        println!(
            "{name:<16} dp {first:6.1} ({dp_1}) {last:6.1} ({dp_30})  largest {size:5.0} ({largest})  radial {radial:.2} (5.17)"
        );
        // The noise of the facts came from another generator. In weak directions, where it is amplified, medians of 20 differ by more.
        let band = if dp_30 > 50.0 { 0.25 } else { 0.10 };
        close(&format!("{name}, one step"), first, dp_1, band);
        close(&format!("{name}, 30 steps"), last, dp_30, band);
        close(&format!("{name}, largest"), size, largest, band);
        // Every solver that converges takes the mean of the noise for distance.
        close(&format!("{name}, radial"), radial, 5.17, 0.02);
    }
    let all = Step::Truncated { cut: 1e-9, unit_m: 1.0 };
    let exact = median_of(&runs(&truth, &qs, 0.0, Kind::Distance, scheme(Form::Factors, all, 5)), 1) * 1e6;
    println!("noise-free, all 12 directions: dp {exact:.1} um (13.0)");
    close("noise-free", exact, 13.0, 0.15);
    let (one, many) = (
        runs(&truth, &qs, 1e-5, Kind::Distance, scheme(Form::Factors, all, 1)),
        runs(&truth, &qs, 1e-5, Kind::Distance, scheme(Form::Factors, all, 30)),
    );
    let (first, last) = (median_of(&one, 1) * 1e6, median_of(&many, 1) * 1e6);
    println!("pseudo-inverse of all 12: dp {first:.0} um (2150), then {last:.1e} um (8.5e2 .. 2.7e6)");
    close("pseudo-inverse, one step", first, 2150.0, 0.25);
    assert!(last > 850.0, "{last}");
}

#[test]
fn damping_in_every_step_fades_out() {
    let machine = machine();
    let qs = table_7_path(&machine, &full_turn(100));
    let truth = true_machine(&machine, Preset::ALL);
    let dp = |steps| {
        let scheme = scheme(Form::Factors, Step::Damped { tau: 1e-2 }, steps);
        median_of(&runs(&truth, &qs, 1e-5, Kind::Distance, scheme)[..], 1) * 1e6
    };
    let [early, best, late] = [dp(5), dp(80), dp(200)];
    println!(
        "tau 1e-2: dp {early:.1} um after 5 steps, {best:.1} after 80 (facts: 19.9), {late:.1} after 200 (facts: 21.4)"
    );
    assert!(best < early && best < late, "{early}, {best}, {late}");
    close("after 80", best, 19.9, 0.1);
    close("after 200", late, 21.4, 0.1);
}

#[test]
fn on_positions_local_and_global_agree_and_free_columns_are_no_better() {
    let machine = machine();
    let truth = true_machine(&machine, Preset::TWISTS);
    let (random, others) = (random_commands(&machine, 100, 3), random_commands(&machine, 400, 4));
    let step = Step::Truncated { cut: 1e-6, unit_m: 1.0 };
    let dp = |qs: &[Vec<f64>], judged: &[Vec<f64>]| {
        [Form::Factors, Form::Tangent, Form::Free]
            .map(|form| runs_judged(&truth, qs, judged, 1e-6, Kind::Position, scheme(form, step, 8)))
    };
    let [local, tangent, free] = dp(&random, &others);
    let [a, b, c] = [&local, &tangent, &free].map(|r| median_of(r, 1) * 1e6);
    let apart = local.iter().zip(&tangent).map(|(l, t)| (l[1] - t[1]).abs()).fold(0.0, f64::max);
    println!(
        "dp at other random poses: local {a:.4} um, tangent {b:.4}, free {c:.4} (facts: 0.876, 0.876, 0.887)"
    );
    println!("local and tangent differ by {apart:.1e} m at most (facts: 3e-17)");
    close("local", a, 0.876, 0.03);
    close("tangent", b, 0.876, 0.03);
    close("free", c, 0.887, 0.03);
    assert!(apart < 1e-12 && c > a, "{apart:e}, {c} against {a}");
    // On the path of table 7 the free columns have ten apparent directions more than the model, and no step puts them right.
    let qs = table_7_path(&machine, &full_turn(100));
    let [d, e, f] = dp(&qs, &qs).map(|r| median_of(&r, 1) * 1e6);
    println!("dp on the path of table 7: local {d:.4} um, tangent {e:.4}, free {f:.1}");
    assert!((d / e - 1.0).abs() < 1e-6 && f > 10.0 * d, "{d}, {e}, {f}");
}

#[test]
fn free_columns_seem_to_see_more_than_there_is() {
    let machine = machine();
    let truth = CalibratedMachine::nominal(machine.clone());
    let paths = [table_7_path(&machine, &full_turn(100)), random_commands(&machine, 200, 5)];
    let theirs = [[12, 12, 22], [14, 14, 29]];
    for (qs, theirs) in paths.iter().zip(theirs) {
        let recordings = [record(&truth, qs, Kind::Distance, 0.0, 0)];
        let ranks = [Form::Factors, Form::Tangent, Form::Free].map(|form| {
            let scheme = scheme(form, Step::GaussNewton, 1);
            let values = scheme.singular_values(&machine, &recordings).unwrap_or_else(|e| panic!("{e}"));
            // Free columns fade away without a gap: on the path one more value lies between 1e-9 and rounding.
            values.iter().filter(|s| **s > 1e-9 * values[0]).count()
        });
        println!("ranks of local, tangent, free: {ranks:?} (facts: {theirs:?})");
        assert_eq!(ranks, theirs);
    }
}

#[test]
fn on_distances_both_well_posed_forms_fit_alike_and_free_columns_do_not() {
    let machine = machine();
    let qs = table_7_path(&machine, &full_turn(100));
    println!("noise U[0, 1 um], medians of {SEEDS} seeds; radial um / dp um / dr urad, facts in brackets");
    let (tau_3, tau_2) = (Step::Damped { tau: 1e-3 }, Step::Damped { tau: 1e-2 });
    let svd = Step::Truncated { cut: 1e-3, unit_m: 1.0 };
    type Row = [f64; 3];
    let rows: [(&str, Preset, Step, [Row; 3]); 7] = [
        (
            "table 2, tau 1e-3",
            Preset::TWISTS,
            tau_3,
            [[0.517, 20.1, 117.0], [0.517, 13.5, 76.0], [4.31, 23.8, 80.0]],
        ),
        (
            "table 2, tau 1e-2",
            Preset::TWISTS,
            tau_2,
            [[0.517, 20.8, 113.0], [0.517, 16.3, 79.0], [3.29, 24.2, 87.0]],
        ),
        (
            "table 2, SVD 1e-3",
            Preset::TWISTS,
            svd,
            [[0.517, 20.1, 118.0], [0.517, 13.8, 75.0], [1.63, 15.2, 80.0]],
        ),
        (
            "tables 2+3, tau 1e-3",
            Preset::ALL,
            tau_3,
            [[0.517, 17.5, 120.0], [0.517, 15.0, 90.0], [2.33, 20.1, 93.0]],
        ),
        (
            "tables 2+3, SVD 1e-3",
            Preset::ALL,
            svd,
            [[0.517, 17.3, 121.0], [0.517, 15.2, 88.0], [1.76, 15.9, 90.0]],
        ),
        (
            "table 3 dh, tau 1e-3",
            Preset::POSES,
            tau_3,
            [[0.517, 9.8, 66.0], [0.517, 9.8, 93.0], [1.53, 14.1, 95.0]],
        ),
        (
            "table 3 dh, SVD 1e-3",
            Preset::POSES,
            svd,
            [[0.517, 9.9, 65.0], [0.517, 10.2, 92.0], [1.39, 8.9, 95.0]],
        ),
    ];
    for (name, preset, step, theirs) in rows {
        let truth = true_machine(&machine, preset);
        let forms = [Form::Factors, Form::Tangent, Form::Free];
        let all = forms.map(|form| runs(&truth, &qs, 1e-6, Kind::Distance, scheme(form, step, 30)));
        let ours = [0, 1, 2].map(|f| [0, 1, 2].map(|k| median_of(&all[f], k) * 1e6));
        let shown: Vec<String> = ours
            .iter()
            .zip(theirs)
            .map(|(o, t)| format!("{:.3} ({}) / {:.1} ({}) / {:.0} ({})", o[0], t[0], o[1], t[1], o[2], t[2]))
            .collect();
        println!("{name}: local {}; tangent {}; free {}", shown[0], shown[1], shown[2]);
        let wins = |f: usize| all[0].iter().zip(&all[f]).filter(|(l, o)| l[1] < o[1]).count();
        println!(
            "  local has the smaller dp in {} of {SEEDS} against tangent, {} against free",
            wins(1),
            wins(2)
        );
        for f in 0..2 {
            close(&format!("{name}, radial"), ours[f][0], theirs[f][0], 0.02);
            close(&format!("{name}, dp"), ours[f][1], theirs[f][1], 0.15);
        }
        // Free columns with projection never reach the fit of the other two.
        assert!(ours[2][0] > 1.5 * ours[0][0], "{name}: {}", ours[2][0]);
    }
}

#[test]
fn both_well_posed_forms_are_there_in_three_truncated_steps() {
    let machine = machine();
    let qs = table_7_path(&machine, &full_turn(100));
    let truth = true_machine(&machine, Preset::TWISTS);
    let svd = Step::Truncated { cut: 1e-3, unit_m: 1.0 };
    let radial =
        |form, steps| median_of(&runs(&truth, &qs, 1e-6, Kind::Distance, scheme(form, svd, steps)), 0) * 1e6;
    for form in [Form::Factors, Form::Tangent] {
        let (three, thirty) = (radial(form, 3), radial(form, 30));
        println!("{form:?}: radial error {three:.4} um after three steps, {thirty:.4} at the end");
        assert!((three / thirty - 1.0).abs() < 1e-3, "{form:?}: {three} against {thirty}");
    }
    let free = radial(Form::Free, 30);
    println!("Free: {free:.3} um after thirty");
    assert!(free > 2.0 * radial(Form::Factors, 3), "{free}");
}
