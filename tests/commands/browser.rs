//! The reports in a browser, as people open them: on a phone, a tablet and a desk, light and dark.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::program::{Folder, PROGRAM, done};

/// Widths of a phone, a tablet and a screen, CSS px.
const WIDTHS: [u32; 3] = [360, 800, 1280];
/// Text below 12 CSS px counts as not legible in Lighthouse, the audit that Chromium brings along.
const LEGIBLE: f64 = 12.0;

/// What a page tells the page around it, once everything that folds is open and every table has been sorted.
const PROBE: &str = r"<script>
const faults = [];
addEventListener('error', e => faults.push(String(e.message)));
addEventListener('load', () => {
    document.querySelectorAll('details').forEach(d => d.open = true);
    document.querySelectorAll('th button').forEach(b => { b.click(); b.click(); });
    dispatchEvent(new Event('beforeprint'));
    const named = e => `${e.tagName} ${e.textContent.trim().slice(0, 60)}`;
    const all = of => [...document.querySelectorAll(of)];
    const beyond = e => e.getBoundingClientRect().right > innerWidth + 0.5;
    const texts = all('svg text').map(e => {
        const svg = e.ownerSVGElement, frame = svg.getBoundingClientRect(), own = e.getBoundingClientRect();
        const size = parseFloat(getComputedStyle(e).fontSize) * frame.width / svg.viewBox.baseVal.width;
        const cut = own.left < frame.left - 1 || own.right > frame.right + 1 || own.top < frame.top - 1 || own.bottom > frame.bottom + 1;
        return { size, cut, name: named(e) };
    });
    parent.postMessage({
        page: location.pathname.split('/').pop(), width: innerWidth, dark: matchMedia('(prefers-color-scheme: dark)').matches,
        overflow: document.documentElement.scrollWidth - innerWidth, beyond: all('body *').filter(beyond).map(named).slice(0, 5),
        scrolled: all('.wide').filter(e => e.scrollWidth > e.clientWidth + 1).map(named), faults,
        smallest: Math.min(...texts.map(t => t.size)), cut: texts.filter(t => t.cut).map(t => t.name),
        texts: texts.length, heads: all('th[aria-sort]').length,
    }, '*');
});
</script>";

/// All pages side by side in frames of all widths, and what each tells, as JSON.
fn around(pages: &[&str]) -> String {
    let mut frames = String::new();
    for page in pages {
        for width in WIDTHS {
            frames += &format!(
                "<iframe src=\"{page}\" width=\"{width}\" height=\"900\" style=\"border:0\"></iframe>\n"
            );
        }
    }
    format!(
        "<!doctype html><meta charset=\"utf-8\"><meta name=\"color-scheme\" content=\"light dark\"><pre></pre>\n<script>
        const found = [];
        addEventListener('message', e => {{ found.push(e.data); document.querySelector('pre').textContent = JSON.stringify(found); }});
        </script>\n{frames}"
    )
}

/// The browser: `KINCAL_BROWSER`, or the first of its usual names on the path.
fn browser() -> Command {
    let usual = ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"];
    let named = std::env::var("KINCAL_BROWSER").ok();
    let runs =
        |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|run| run.status.success());
    let name = named.as_deref().or_else(|| usual.into_iter().find(runs));
    let mut command =
        Command::new(name.expect("a browser: Chromium on the path, or its place in KINCAL_BROWSER"));
    // Root has no sandbox, and no page here is anybody else's.
    command.args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]);
    command
}

/// What every page says of itself at every width.
fn told(folder: &Folder, around: &str, dark: bool) -> Vec<Value> {
    let mut command = browser();
    // 0 is dark in Blink's settings, 1 light.
    command.arg(format!("--blink-settings=preferredColorScheme={}", u8::from(!dark)));
    command.arg(format!("--user-data-dir={}", folder.path("profile")));
    // Of the browser's own clock, which runs as fast as there is nothing to wait for.
    command.args(["--virtual-time-budget=20000", "--dump-dom"]);
    let run = command.arg(format!("file://{}", folder.path(around))).output().expect("a browser that runs");
    let text = String::from_utf8_lossy(&run.stdout);
    let found = text.split("<pre>").nth(1).and_then(|part| part.split("</pre>").next()).unwrap_or_default();
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let errors = String::from_utf8_lossy(&run.stderr);
    serde_json::from_str(&found).unwrap_or_else(|error| panic!("{error}: {found}\n{errors}"))
}

/// Reports of all three commands: a ballbar whose file has a long name, an arm with poses, a machine with findings, a program.
fn reports(folder: &Folder) -> Vec<&'static str> {
    let machine = "machines/ac_table_tilting.ron";
    let rec = folder.path("bk4_cone_of_90_deg_after_warm_up_second_spindle_nose_100_mm_bar.csv");
    let cone =
        ["--test", "BK4", "--length", "100mm", "--lead", "60deg", "--sense", "both", "--noise", "0.5um"];
    done(&[&["simulate", machine, "-o", &rec, "--random", "1"][..], &cone].concat());
    let [bar, arm, program] =
        ["calibrate.html", "calibrate_arm.html", "compensate.html"].map(|n| folder.path(n));
    let [file, out, part, poses] = ["found.ron", "out.nc", "part.nc", "poses.csv"].map(|n| folder.path(n));
    done(&["calibrate", machine, &rec, "-o", &file, "--report", &bar, "--quiet"]);
    let panda = "machines/franka_panda.ron";
    let pose = ["--test", "poses", "--count", "60", "--measure", "pose", "--random", "1", "--noise", "20um"];
    done(&[&["simulate", panda, "-o", &poses][..], &pose, &["--noise-angle", "50urad"]].concat());
    done(&["calibrate", panda, &poses, "--report", &arm, "--quiet"]);
    std::fs::write(&part, "G21 G90\nG0 X10 Y20 Z30 A-40 C50\nG1 X60 F500\nM30\n").expect("written");
    done(&["compensate", &file, &part, "-o", &out, "--report", &program, "--force", "--quiet"]);
    let demo = Command::new(PROGRAM).args(["demo", "--quiet"]).current_dir(&folder.0).status();
    assert!(demo.expect("it runs").success());
    vec!["calibrate.html", "calibrate_arm.html", "compensate.html", "kincal_demo.html"]
}

#[test]
#[ignore = "needs Chromium: on the path, or in KINCAL_BROWSER"]
fn reports_can_be_read_on_phone_and_screen_light_and_dark() {
    let folder = Folder::new("reports_in_a_browser");
    let pages = reports(&folder);
    for page in &pages {
        let path = folder.path(page);
        let text = std::fs::read_to_string(&path).expect("a page");
        let (head, rest) = text.split_once("<head>").expect("a head");
        std::fs::write(&path, format!("{head}<head>{PROBE}{rest}")).expect("written");
    }
    std::fs::write(Path::new(&folder.path("all.html")), around(&pages)).expect("written");
    for dark in [false, true] {
        let told = told(&folder, "all.html", dark);
        let seen: BTreeSet<(String, u64)> =
            told.iter().map(|t| (t["page"].to_string(), t["width"].as_u64().unwrap_or(0))).collect();
        assert_eq!(seen.len(), pages.len() * WIDTHS.len(), "{seen:?}");
        for page in &told {
            let none = |key: &str| page[key].as_array().is_some_and(Vec::is_empty);
            assert_eq!(page["dark"], dark, "{page}");
            assert!(page["texts"].as_u64() > Some(3) && page["heads"].as_u64() > Some(1), "{page}");
            assert!(none("faults"), "an error of a script: {page}");
            assert_eq!(page["overflow"], 0, "wider than the screen: {page}");
            assert!(none("scrolled"), "a table that has to be moved sideways: {page}");
            assert!(page["smallest"].as_f64() >= Some(LEGIBLE), "too small to be read: {page}");
            assert!(none("cut"), "text that is cut off: {page}");
        }
    }
}
