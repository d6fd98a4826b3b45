//! The page of `--report`: one file that anybody can open, with the numbers of the JSON, from all three commands.

use serde_json::Value;

use crate::program::{Folder, done, fails};

const MACHINE: &str = "machines/ac_table_tilting.ron";
/// Largest page, bytes.
const LARGEST: usize = 500_000;

/// Every element that is opened is closed in its turn.
fn assert_well_formed(page: &str) {
    const VOID: [&str; 3] = ["meta", "br", "hr"];
    // What stands in the script is no markup.
    let (head, rest) = page.split_once("<script>").expect("a script");
    let (_, tail) = rest.split_once("</script>").expect("its end");
    let mut open: Vec<&str> = Vec::new();
    for tag in head.split('<').skip(1).chain(tail.split('<').skip(1)) {
        let tag = tag.split_once('>').unwrap_or_else(|| panic!("a tag does not end: {tag}")).0;
        let name = tag.split([' ', '/']).find(|part| !part.is_empty()).unwrap_or("");
        match tag.starts_with('/') {
            true => assert_eq!(open.pop(), Some(name), "</{name}> closes what is not open"),
            false if tag.starts_with('!') || VOID.contains(&name) => {}
            false => open.push(name),
        }
    }
    assert!(open.is_empty(), "never closed: {open:?}");
}

/// What holds of every page.
pub fn assert_page(page: &str) {
    assert_well_formed(page);
    assert!(page.len() < LARGEST, "{} bytes", page.len());
    for from_elsewhere in
        ["<script ", "<link", "<img", "<iframe", " src=", " href=", "url(", "@import", "fetch("]
    {
        assert!(!page.contains(from_elsewhere), "{from_elsewhere}");
    }
    // The name of SVG is the only address.
    let without = page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    assert!(!without.contains("http"), "an address");
    for part in ["prefers-color-scheme:dark", "@media print", "name=\"viewport\"", "lang=\"en\""] {
        assert!(page.contains(part), "{part}");
    }
    let figures: Vec<&str> = page.split("<svg ").skip(1).collect();
    assert!(!figures.is_empty());
    for figure in figures {
        let figure = figure.split("</svg>").next().unwrap_or_default();
        assert!(figure.starts_with("xmlns") && figure.contains("role=\"img\""), "{:.80}", figure);
        for element in ["title", "desc"] {
            let text = figure.split(&format!("<{element}>")).nth(1).and_then(|t| t.split('<').next());
            assert!(text.is_some_and(|text| text.trim().len() > 3), "no {element}: {figure:.200}");
        }
    }
    for none in ["NaN", ">inf<", "-0<", " NaN", "inf "] {
        assert!(!page.contains(none), "a number that is none: {none}");
    }
}

fn json(path: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a result")).expect("JSON")
}

/// Whether a number of the JSON stands in a table of the page, but for the last bit, which reading JSON may lose.
pub fn has(page: &str, number: &Value) -> bool {
    let number = number.as_f64().expect("a number");
    let values =
        page.split("data-v=\"").skip(1).filter_map(|part| part.split('"').next()?.parse::<f64>().ok());
    values.into_iter().any(|value| (value - number).abs() <= 1e-14 * number.abs())
}

/// A ballbar on a cone of the reference machine with errors of its own.
fn ballbar(folder: &Folder) -> String {
    let rec = folder.path("cone.csv");
    let options =
        ["--test", "BK4", "--length", "100mm", "--step", "2deg", "--lead", "60deg", "--sense", "both"];
    let mut call = vec!["simulate", MACHINE, "-o", &rec, "--random", "1", "--noise", "0.5um"];
    call.extend(options);
    done(&call);
    rec
}

#[test]
fn a_calibration_has_its_page_with_the_figures_of_the_json() {
    let folder = Folder::new("page_of_calibrate");
    let rec = ballbar(&folder);
    let [report, result, file] = ["page.html", "result.json", "found.ron"].map(|name| folder.path(name));
    let with_name = std::fs::read_to_string(&rec).expect("a recording");
    std::fs::write(&rec, format!("# instrument: ballbar <4711>, 0.1 um\n{with_name}")).expect("written");
    let text = done(&["calibrate", MACHINE, &rec, "--report", &report, "--json", &result, "-o", &file]);
    assert!(text.starts_with("The machine is ") && text.contains("report written to "), "{text}");
    let page = std::fs::read_to_string(&report).expect("a page");
    assert_page(&page);
    let found = json(&result);
    let verdict = found["verdict"].as_str().expect("a sentence");
    assert!(page.contains(&format!("<p class=\"verdict\">{verdict}</p>")) && text.starts_with(verdict));
    for stage in ["nominal", "geometric"] {
        assert!(has(&page, &found["rms_m"][stage]), "{stage}");
    }
    let test = &found["circular_tests"][0];
    for sense in ["counter_clockwise", "clockwise"] {
        for figure in ["g_m", "f_max_m", "f_min_m"] {
            assert!(has(&page, &test[sense][figure]), "{sense} {figure}");
        }
    }
    for figure in ["g_both_m", "h_m", "d_m"] {
        assert!(has(&page, &test[figure]), "{figure}");
    }
    for error in found["location_errors"]["errors"].as_array().expect("a list") {
        assert!(has(&page, &error["value"]), "{}", error["name"]);
    }
    assert!(section(&page, "Files").contains("ballbar &lt;4711&gt;, 0.1 um: distance, 100 mm"));
    let sections =
        ["What to do", "Before and after", "Circular tests", "Residuals against time", "What to enter"];
    let further = ["What could not be seen", "The next measurement", "The machine", "Files"];
    for section in sections.into_iter().chain(further) {
        assert!(page.contains(&format!("<h2>{section}</h2>")), "{section}");
    }
    // The numbers to enter are those of the export.
    let numbers = folder.path("numbers.json");
    done(&["export", &file, "--to", "siemens", "-o", &folder.path("out.spf"), "--json", &numbers]);
    let numbers = json(&numbers);
    let numbers = numbers["numbers"].as_array().expect("a list");
    for number in numbers.iter().filter(|number| !number["value"].is_null()) {
        assert!(page.contains(number["name"].as_str().expect("a name")), "{number}");
    }
}

/// What stands between the head of this section and the next one.
fn section<'a>(page: &'a str, name: &str) -> &'a str {
    let behind = page.split_once(&format!("<h2>{name}</h2>")).expect("the section").1;
    behind.split("<h2>").next().unwrap_or_default()
}

#[test]
fn what_a_report_calls_not_identified_it_does_not_enter() {
    let folder = Folder::new("page_that_agrees");
    let [report, result, rec] = ["page.html", "result.json", "rec.csv"].map(|name| folder.path(name));
    // Cones and a plane; one of them leaves a little of the place of C where it sees nothing at all. Poses see everything.
    let cone = "BK4 --length 100mm --step 3deg --lead 60deg --sense both";
    let bars = [cone, "BK4 --length 100mm --step 3deg", "BK1 --length 100mm --step 3deg"];
    let (mut held, mut entered, mut explained) = (0, 0, 0);
    for test in bars.into_iter().chain(["poses --count 100 --measure position"]) {
        let call = ["simulate", MACHINE, "-o", &rec, "--random", "1", "--noise", "0.5um", "--test"];
        done(&call.into_iter().chain(test.split(' ')).collect::<Vec<_>>());
        done(&["calibrate", MACHINE, &rec, "--report", &report, "--json", &result]);
        let page = std::fs::read_to_string(&report).expect("a page");
        let to_enter = section(&page, "What to enter");
        let found = json(&result);
        let errors = found["location_errors"]["errors"].as_array().expect("a list");
        // Nobody sees why else 99 % of it should not be enough.
        let is_odd = |error: &Value| error["identified"] == false && error["share"].as_f64() >= Some(0.9);
        let says = page.contains("see nothing at all; a test of another kind shows it");
        assert_eq!(says, errors.iter().any(is_odd), "{test}");
        explained += u32::from(says);
        for error in errors {
            let name = error["name"].as_str().expect("a name");
            // The same place, as HEIDENHAIN has it: `c.X` is `EX0C`.
            let place = |axis: char| format!("{}.{}", name[3..].to_lowercase(), axis);
            let also = name.chars().nth(1).filter(|axis| "XYZ".contains(*axis)).map(place);
            for name in also.as_deref().into_iter().chain([name]) {
                let is_entered = to_enter.contains(&format!(">{name}</td>"));
                let identified = error["identified"].as_bool().expect("yes or no");
                assert!(identified || !is_entered, "{test}: {name} of {error}");
                held += u32::from(!identified);
                entered += u32::from(is_entered);
            }
        }
    }
    assert!(held > 20 && entered > 12 && (1..4).contains(&explained), "{held}, {entered}, {explained}");
}

#[test]
fn a_compensation_has_its_page_with_the_figures_of_the_json() {
    let folder = Folder::new("page_of_compensate");
    let rec = ballbar(&folder);
    let [file, program, out, report, result] =
        ["found.ron", "part.nc", "out.nc", "page.html", "result.json"].map(|name| folder.path(name));
    done(&["calibrate", MACHINE, &rec, "-o", &file]);
    std::fs::write(&program, "G21 G90\nG0 X10 Y20 Z30 A-40 C50\nG1 X60 F500\nM30\n").expect("written");
    done(&["compensate", &file, &program, "-o", &out, "--report", &report, "--json", &result, "--force"]);
    let page = std::fs::read_to_string(&report).expect("a page");
    assert_page(&page);
    let found = json(&result);
    for figure in ["largest_correction_m", "largest_left_m"] {
        assert!(has(&page, &found[figure]["value"]), "{figure}");
    }
    assert!(page.contains("part.nc") && page.contains("This program would be cut up to "));
}

#[test]
fn a_call_that_fails_leaves_no_page() {
    let folder = Folder::new("no_page");
    let rec = folder.path("broken.csv");
    let text = "# measurement: distance\n# nominal_length[mm]: 100\nx[mm],y[mm],z[mm],a[deg],c[deg],d[mm]\n0,0,0,0,0,a lot\n";
    std::fs::write(&rec, text).expect("written");
    let report = folder.path("page.html");
    for command in ["calibrate", "diagnose"] {
        let err = fails(1, &[command, MACHINE, &rec, "--report", &report]);
        assert!(err.contains("broken.csv:4"), "{err}");
    }
    std::fs::write(folder.path("part.nc"), "G1 X1 F\u{0}\n(open\n").expect("written");
    fails(1, &["compensate", &folder.path("none.ron"), &folder.path("part.nc"), "--report", &report]);
    // An input is never overwritten by a page.
    fails(1, &["calibrate", MACHINE, &rec, "--report", &rec]);
    assert_eq!(folder.names(), ["broken.csv", "part.nc"]);
    assert_eq!(std::fs::read_to_string(&rec).expect("there"), text);
}
