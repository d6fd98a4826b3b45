//! Which columns hold what was measured.

use super::draft::Draft;
use super::groups::{self, Angles, Group};
use super::heading::Stated;
use super::joints;
use super::matrix;
use super::request::R_TEST;
use super::rotation::{CONVENTIONS, Euler};
use crate::units::Quantity;
use crate::wording::shown;

/// What a recording may hold, as `--measurement` calls it.
const KINDS: [&str; 5] = ["position", "pose", "joint", "distance", "displacement"];

/// Takes the measured columns; what is not found or may be read in several ways is asked.
pub(super) fn take(draft: &mut Draft) {
    let asked = draft.request.measurement.clone();
    if let Some(word) = asked.as_ref().filter(|word| !KINDS.contains(&word.as_str())) {
        let what = format!("measurement `{}` is not known", shown(word));
        return draft.ask(what, format!("--measurement {}|{}", KINDS.join("|"), R_TEST));
    }
    if let Some(word) = told(draft) {
        draft.map.measurement = word;
        return;
    }
    let wants = |word: &str| asked.as_deref().is_none_or(|a| a == word);
    let matrix = if wants("pose") { matrix::find(draft) } else { None };
    if let Some(elements) = matrix {
        draft.map.measurement = "pose".into();
        for (i, j, column) in elements.0 {
            draft.take(&format!("matrix{}{}", i + 1, j + 1), column, None);
        }
        return;
    }
    let mut groups = groups::find(draft);
    if !wants("position") && !wants("pose") {
        groups.clear();
    }
    let markers = &draft.request.markers;
    if !markers.is_empty() {
        if let Some(missing) = markers.iter().find(|m| !groups.iter().any(|g| g.name == **m)) {
            let names = groups.iter().map(|g| g.name.as_str()).filter(|name| !name.is_empty());
            let names: Vec<&str> = names.collect();
            let what = format!("marker `{missing}`: the table has none of this name");
            let tell = match names.is_empty() {
                true => "leave --marker out: a row has one point at most".into(),
                false => format!("--marker with one of: {}", names.join(", ")),
            };
            return draft.ask(what, tell);
        }
        groups.retain(|g| markers.contains(&g.name));
    }
    groups.retain(|g| g.point().is_some());
    let read = if wants("joint") { joints::read(draft) } else { Vec::new() };
    // Coordinates `x_act y_act z_act` of a machine with such axes are what was read of these.
    let is_read = |column: &usize| read.iter().any(|(_, columns)| columns.contains(column));
    groups.retain(|g| !g.point().is_some_and(|point| point.iter().all(is_read)));
    let scalar = scalar(draft, &wants);
    match (groups.is_empty(), &read[..], &scalar) {
        (false, [], None) => points(draft, &groups, asked.as_deref()),
        (true, [_], None) => reference(draft, &read),
        (true, [_, ..], None) => {
            let kinds: Vec<String> =
                read.iter().map(|(joint, columns)| format!("{joint} ({})", draft.named(columns))).collect();
            let what = format!("which joint was measured: {}; a recording is of one", kinds.join(", "));
            let (joint, columns) = &read[0];
            let own = columns.first().map_or(String::new(), |c| draft.table.reference(*c));
            draft.ask(what, format!("--column '{joint}_meas={own}', say"));
        }
        (true, [], Some((to, column))) => {
            draft.map.measurement = if *to == "s" { "displacement" } else { "distance" }.into();
            draft.take(to, *column, None);
        }
        (true, [], None) => {
            let free = draft.free(None);
            let what = format!(
                "which columns were measured; columns without a part: {}{}",
                draft.named(&free),
                odd_units(draft, &free)
            );
            let tell = "--column 'px=NAME' ... (position), 'JOINT_meas=NAME' (a reference of one joint), 'd=NAME' or 'r=NAME' \
                        (distance), 's=NAME' (displacement)";
            draft.ask(what, tell);
        }
        _ => {
            let mut kinds = Vec::new();
            kinds.extend(groups.iter().map(|g| format!("a point `{}`", g.name)));
            kinds.extend(
                read.iter()
                    .map(|(joint, columns)| format!("a reference of {joint} ({})", draft.named(columns))),
            );
            kinds.extend(scalar.iter().map(|(to, _)| format!("`{to}`")));
            let what = format!("what was measured; the table has {}", kinds.join(", "));
            draft.ask(
                what,
                "--measurement position|pose|joint|distance|displacement, or --column 'JOINT_meas=NAME'",
            );
        }
    }
}

/// Units of columns without a part that recordings do not have: a reason why they have none.
fn odd_units(draft: &Draft, columns: &[usize]) -> String {
    let mut odd: Vec<&str> = Vec::new();
    for column in columns {
        match &draft.table.headings[*column].unit {
            Stated::Other(text) if !odd.contains(&text.as_str()) => odd.push(text),
            _ => {}
        }
    }
    if odd.is_empty() { String::new() } else { format!("; no units of recordings: {}", odd.join(", ")) }
}

/// The measurement that columns named by the user make.
fn told(draft: &Draft) -> Option<String> {
    let has = |names: &[&str]| names.iter().any(|name| draft.has(name));
    let turned = draft.map.columns.iter().any(|p| p.to.starts_with("euler") || p.to.starts_with("matrix"));
    let joint = draft.map.columns.iter().any(|p| p.to.ends_with("_meas"));
    let word = match () {
        () if joint => "joint",
        () if turned || has(&["qw", "rx"]) => "pose",
        () if has(&["px", "py", "pz"]) => "position",
        () if has(&["d", "r"]) => "distance",
        () if has(&["s"]) => "displacement",
        () => return None,
    };
    Some(draft.request.measurement.clone().unwrap_or_else(|| word.into()))
}

/// A column that bears the name of a distance or a displacement.
fn scalar(draft: &Draft, wants: &impl Fn(&str) -> bool) -> Option<(&'static str, usize)> {
    let kinds = [("d", "distance"), ("r", "distance"), ("s", "displacement")];
    let free = draft.free(Some(Quantity::Length));
    let named = kinds.into_iter().filter(|(_, word)| wants(word)).find_map(|(to, _)| {
        let column = free.iter().find(|i| draft.table.headings[**i].name == to)?;
        Some((to, *column))
    });
    // Beside a path the one column of lengths can be nothing else.
    match free[..] {
        [column] if draft.request.path.is_some() && wants("distance") => named.or(Some(("d", column))),
        _ => named,
    }
}

fn reference(draft: &mut Draft, read: &[(String, Vec<usize>)]) {
    draft.map.measurement = "joint".into();
    let (joint, columns) = &read[0];
    match columns[..] {
        [column] => draft.take(&format!("{joint}_meas"), column, None),
        _ => {
            let what = format!("what was read of joint `{joint}`: {} may be it", draft.named(columns));
            draft.ask(what, format!("--column '{joint}_meas=NAME'"));
        }
    }
}

fn points(draft: &mut Draft, groups: &[Group], asked: Option<&str>) {
    let turned = groups.iter().filter(|g| g.is_turned()).count();
    let pose = asked == Some("pose") || (asked.is_none() && turned == groups.len());
    draft.map.measurement = if pose { "pose" } else { "position" }.into();
    let several = groups.len() > 1;
    if several {
        let names: Vec<&str> = groups.iter().map(|g| g.name.as_str()).collect();
        draft.told.push(format!(
            "{} markers, a recording each: {}; `--marker NAME` takes one",
            groups.len(),
            names.join(", ")
        ));
        if !draft.map.head.iter().any(|line| line.trim_start_matches(['#', ' ']).starts_with("tool_point")) {
            draft.map.head.push("tool_point: unknown {marker}".into());
            draft.told.push(
                "where each marker is on the tool is taken as unknown: `tool_point: unknown {marker}`".into(),
            );
        }
    }
    for group in groups {
        let marker = several.then_some(group.name.as_str());
        let Some(point) = group.point() else { continue };
        for (to, column) in ["px", "py", "pz"].into_iter().zip(point) {
            draft.take(to, column, marker);
        }
        if pose {
            rotation(draft, group, marker);
        }
    }
    let is_framed = |line: &String| line.trim_start_matches(['#', ' ']).starts_with("workpiece_frame");
    if !draft.map.head.iter().any(is_framed) {
        draft.told.push(
            "frame w is taken as that of the instrument; if nobody knows where that stands, say --head 'workpiece_frame: unknown'".into(),
        );
    }
}

fn rotation(draft: &mut Draft, group: &Group, marker: Option<&str>) {
    if let [Some(w), Some(x), Some(y), Some(z)] = group.quaternion {
        for (to, column) in [("qw", w), ("qx", x), ("qy", y), ("qz", z)] {
            draft.take(to, column, marker);
        }
        return;
    }
    let all = |list: [Option<usize>; 3]| list.iter().copied().collect::<Option<Vec<usize>>>();
    let (lists, columns) = match (group.angles, all(group.about)) {
        (_, Some(columns)) => (None, columns),
        (Some((angles, list)), None) => match all(list) {
            Some(columns) => (Some(angles), columns),
            None => return,
        },
        (None, None) => {
            let what = format!("the rotation of `{}`", group.name);
            return draft.ask(
                what,
                "--column 'qw=NAME' ... or 'euler1=NAME' ... with --euler, or --measurement position",
            );
        }
    };
    if draft.request.rotation_vector && lists.is_none() {
        for (to, column) in ["rx", "ry", "rz"].into_iter().zip(columns) {
            draft.take(to, column, marker);
        }
        return;
    }
    let Some(word) = draft.request.euler.clone() else {
        let shown = draft.named(&columns);
        let vector = if lists.is_none() { "--rotation-vector, or " } else { "" };
        let what = format!("convention of the angles {shown}");
        return draft.ask(what, format!("{vector}--euler with {CONVENTIONS}"));
    };
    let Some(euler) = Euler::named(&word) else {
        return draft.ask(format!("convention `{word}` is not known"), format!("--euler with {CONVENTIONS}"));
    };
    draft.map.euler = Some(word);
    // Lists that name axes are put into the order of the convention; A, B, C and W, P, R are written in that order.
    let by_axis = matches!(lists, None | Some(Angles::RollPitchYaw));
    let distinct = euler.axes[0] != euler.axes[2];
    if by_axis && !distinct {
        let shown = draft.named(&columns);
        return draft.ask(
            format!("angles {shown}: the convention turns twice about one axis"),
            "--column 'euler1=NAME' 'euler2=NAME' 'euler3=NAME'",
        );
    }
    for k in 0..3 {
        let column = if by_axis { columns[euler.axes[k]] } else { columns[k] };
        draft.take(&format!("euler{}", k + 1), column, marker);
    }
}

/// Takes what effects may use besides: temperatures, currents, forces. Columns of other kinds are left out.
pub(super) fn channels(draft: &mut Draft) {
    use Quantity::{Current, Force, Temperature, Torque, Voltage};
    let mut left = Vec::new();
    for column in draft.free(None) {
        let heading = &draft.table.headings[column];
        let useful = match &heading.unit {
            Stated::Unit(unit) => [Current, Force, Temperature, Torque, Voltage].contains(&unit.quantity()),
            _ => false,
        };
        let name: String =
            heading.name.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' }).collect();
        let name = name.trim_matches('_').to_string();
        if useful && !name.is_empty() && !draft.has(&name) {
            draft.take(&name, column, None);
        } else {
            left.push(column);
        }
    }
    if !left.is_empty() {
        let shown: Vec<String> = left.iter().map(|i| format!("`{}`", draft.table.called(*i))).collect();
        draft.told.push(format!("left out: {}", shown.join(", ")));
    }
}
