//! What a diagnosis says of a case, and the engine behind the command line. Neither ever sees an answer.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::Value;

use super::proposed::Trial;

/// The files of a case that may be looked at.
#[derive(Clone, Debug)]
pub struct CaseFiles {
    pub label: String,
    pub machine: PathBuf,
    pub recordings: Vec<PathBuf>,
    /// The noise-free path that nobody fits; of a machine rid of what is outside every vocabulary.
    pub judge: Option<PathBuf>,
    /// The same path of the machine as it was recorded, where that is another.
    pub judge_as_is: Option<PathBuf>,
}

/// One named effect.
#[derive(Clone, Debug)]
pub struct Finding {
    pub effect: String,
    pub at: String,
    pub probability: f64,
    /// Name, value, standard error.
    pub coefficients: Vec<(String, f64, f64)>,
    pub confusable: Vec<(String, String)>,
}

#[derive(Clone, Debug, Default)]
pub struct Verdict {
    pub findings: Vec<Finding>,
    /// Where something is left that has no name.
    pub unexplained: Option<String>,
    /// Part of the structure that the named effects' shapes take up.
    pub shape_share: Option<f64>,
    /// RMS on data not used for the fit, with everything found modelled, m or rad.
    pub held_out: Option<f64>,
    /// RMS error on the judge's path, of the machine as it was recorded: plain calibration, diagnosed model.
    pub judged: Option<(f64, f64)>,
    /// The same where it is rid of what is outside every vocabulary.
    pub rid: Option<(f64, f64)>,
    pub seconds: f64,
    pub samples: f64,
    /// Rules that were asked, where that is told.
    pub asked: Vec<String>,
}

/// Anything that diagnoses.
pub trait Diagnoser: Sync {
    fn name(&self) -> String;

    /// # Errors
    /// What went wrong, in words.
    fn diagnose(&self, case: &CaseFiles) -> Result<Verdict, String>;
}

/// `kincal diagnose`, one core a case.
pub struct Engine {
    /// The `kincal` binary.
    pub binary: PathBuf,
    /// Folder for its outputs.
    pub scratch: PathBuf,
    /// Further arguments of `diagnose`, such as `--without NAME`.
    pub extra: Vec<String>,
    /// Whether the diagnosed model is tried on the judge's path.
    pub judged: bool,
    /// Rules that are left out, by name; the binary has the feature `measure` where there are any. With none of them in the list it says
    /// which it would have asked.
    pub ablated: Option<String>,
}

impl Engine {
    /// With a folder of its own: several engines of one process, which the tests are, diagnose cases of the same label at once.
    pub fn new(binary: PathBuf) -> Self {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let scratch = std::env::temp_dir().join(format!("kincal-blind-{}-{number}", std::process::id()));
        Engine { binary, scratch, extra: Vec::new(), judged: true, ablated: None }
    }

    /// The same for one case, with families left out and no path to be judged on.
    pub fn without(&self, names: &[&String], label: &str) -> Self {
        let left_out = names.iter().flat_map(|name| ["--without".to_string(), (*name).clone()]);
        Engine {
            binary: self.binary.clone(),
            scratch: self.scratch.join(format!("{label}-left-out")),
            extra: self.extra.iter().cloned().chain(left_out).collect(),
            judged: false,
            ablated: None,
        }
    }

    /// The same for one case with a rule left out, or with none, but told which were asked.
    pub fn ablated(&self, rule: &str, label: &str) -> Self {
        Engine {
            binary: self.binary.clone(),
            scratch: self.scratch.join(format!("{label}-without-{rule}")),
            extra: self.extra.clone(),
            judged: self.judged,
            ablated: Some(rule.to_string()),
        }
    }

    /// Diagnoses a case with the whole library, without some families, and with what is proposed in their place.
    ///
    /// # Errors
    /// What went wrong, in words.
    pub fn proposed(&self, left_out: &BTreeSet<String>, case: &CaseFiles) -> Result<Trial, String> {
        let own = self.scratch.join(format!("{}-proposed", case.label));
        std::fs::create_dir_all(&own).map_err(|e| format!("{}: {e}", own.display()))?;
        let judge = case.judge.as_ref().ok_or("the case has no path to be judged on")?;
        let (model, json, new) = (own.join("model.ron"), own.join("said.json"), own.join("new.ron"));
        let without: Vec<&str> = left_out.iter().flat_map(|name| ["--without", name]).collect();
        let error = |more: &[&dyn AsRef<std::ffi::OsStr>]| {
            let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"diagnose", &case.machine];
            case.recordings.iter().for_each(|r| arguments.push(r));
            arguments.extend([&"--json" as &dyn AsRef<std::ffi::OsStr>, &json, &"-o", &model]);
            arguments.extend(more);
            self.call(&arguments)?;
            Ok::<_, String>((self.predicted(&model, judge)?, read_json(&json)?))
        };
        let names: Vec<&dyn AsRef<std::ffi::OsStr>> = without.iter().map(|x| x as _).collect();
        let (family, _) = error(&[])?;
        let with = |flag: &'static &'static str| [names.as_slice(), &[flag as _, &new]].concat();
        let (bare, said) = error(&with(&"--propose"))?;
        let proposed = match new.exists() {
            true => Some(error(&with(&"--effects"))?.0),
            false => None,
        };
        let _ = std::fs::remove_dir_all(&own);
        let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
        let law = |p: &Value| {
            let terms: Vec<String> =
                list(&p["law"]).iter().filter_map(|t| t.as_str().map(String::from)).collect();
            format!("{}: {}", p["at"].as_str().unwrap_or_default(), terms.join(" + "))
        };
        let laws = list(&said["proposals"]).iter().map(law).collect();
        let named = Verdict::read(&said).findings.iter().map(|f| format!("{} {}", f.effect, f.at)).collect();
        Ok(Trial { family, without: bare, proposed, laws, named })
    }

    /// Calls the binary; returns the rules that it says it asked.
    fn call(&self, arguments: &[&dyn AsRef<std::ffi::OsStr>]) -> Result<Vec<String>, String> {
        let mut command = Command::new(&self.binary);
        arguments.iter().for_each(|a| {
            command.arg(a);
        });
        command.arg("--quiet").env("RAYON_NUM_THREADS", "1");
        if let Some(rules) = &self.ablated {
            command.env("KINCAL_ABLATE", rules);
        }
        let out = command.output().map_err(|e| format!("{}: {e}", self.binary.display()))?;
        let said = String::from_utf8_lossy(&out.stderr);
        if out.status.success() {
            return Ok(said.lines().filter_map(|line| line.strip_prefix("rule ")).map(Into::into).collect());
        }
        let message = said.lines().find(|line| !line.starts_with("rule "));
        Err(message.unwrap_or("it failed and said nothing").to_string())
    }

    fn predicted(&self, calibrated: &Path, judge: &Path) -> Result<f64, String> {
        let (csv, json) = (calibrated.with_extension("csv"), calibrated.with_extension("json"));
        self.call(&[&"predict", &calibrated, &judge, &"-o", &csv, &"--json", &json])?;
        let read = read_json(&json)?;
        rms(&read).ok_or_else(|| "predict told no RMS".to_string())
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.scratch);
    }
}

/// `rms_m`, or `rms_rad` of an angle.
fn rms(value: &Value) -> Option<f64> {
    value["rms_m"].as_f64().or_else(|| value["rms_rad"].as_f64())
}

fn read_json(file: &Path) -> Result<Value, String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", file.display()))
}

impl Diagnoser for Engine {
    fn name(&self) -> String {
        "kincal diagnose".into()
    }

    fn diagnose(&self, case: &CaseFiles) -> Result<Verdict, String> {
        let own = self.scratch.join(&case.label);
        std::fs::create_dir_all(&own).map_err(|e| format!("{}: {e}", own.display()))?;
        let (model, json) = (own.join("diagnosed.ron"), own.join("diagnosis.json"));
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"diagnose", &case.machine];
        case.recordings.iter().for_each(|r| arguments.push(r));
        arguments.extend([&"--json" as &dyn AsRef<std::ffi::OsStr>, &json, &"-o", &model]);
        self.extra.iter().for_each(|a| arguments.push(a));
        let started = Instant::now();
        let asked = self.call(&arguments)?;
        let seconds = started.elapsed().as_secs_f64();
        let mut verdict = Verdict { seconds, asked, ..Verdict::read(&read_json(&json)?) };
        if let (true, Some(judge)) = (self.judged, &case.judge) {
            let plain = own.join("plain.ron");
            let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"calibrate", &case.machine];
            case.recordings.iter().for_each(|r| arguments.push(r));
            arguments.extend([&"-o" as &dyn AsRef<std::ffi::OsStr>, &plain]);
            self.call(&arguments)?;
            let errors =
                |path: &Path| Ok::<_, String>((self.predicted(&plain, path)?, self.predicted(&model, path)?));
            verdict.judged = Some(errors(judge)?);
            if let Some(as_is) = &case.judge_as_is {
                verdict.rid = verdict.judged.replace(errors(as_is)?);
            }
        }
        let _ = std::fs::remove_dir_all(&own);
        Ok(verdict)
    }
}

impl Verdict {
    /// From the JSON of `contract.md` section 3.
    pub fn read(json: &Value) -> Self {
        let text = |v: &Value| v.as_str().unwrap_or_default().to_string();
        let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
        let finding = |f: &Value| Finding {
            effect: text(&f["effect"]),
            at: text(&f["at"]),
            probability: f["probability"].as_f64().unwrap_or(f64::NAN),
            coefficients: list(&f["coefficients"])
                .iter()
                .filter_map(|c| Some((text(&c["name"]), c["value"].as_f64()?, c["std_error"].as_f64()?)))
                .collect(),
            confusable: (list(&f["also_at"]).iter().map(|c| (text(&f["effect"]), text(&c["at"]))))
                .chain(list(&f["confusable_with"]).iter().map(|c| (text(&c["effect"]), text(&c["at"]))))
                .collect(),
        };
        let held = ["held_out_rms_m", "held_out_rms_rad"];
        Verdict {
            findings: list(&json["findings"]).iter().map(finding).collect(),
            unexplained: (!json["unexplained"].is_null()).then(|| text(&json["unexplained"]["at"])),
            shape_share: json["shape_share"].as_f64(),
            held_out: held.iter().find_map(|h| json[*h]["final"].as_f64()),
            judged: None,
            rid: None,
            seconds: 0.0,
            samples: json["samples"].as_f64().unwrap_or(0.0),
            asked: Vec::new(),
        }
    }
}
