//! Answers, as the scorer reads them: `answers.json` of the harness or of the practice folder.

use std::path::Path;

use serde_json::Value;

use super::folder::AS_IS;
use super::verdict::{CaseFiles, Finding};

/// A concealed effect.
#[derive(Clone, Debug)]
pub struct Truth {
    pub effect: String,
    pub at: String,
    pub snr: f64,
    /// Names and places that the recordings cannot tell from it.
    pub also: Vec<(String, String)>,
    /// Coefficients in SI, where the law is a textbook's.
    pub coefficients: Vec<(String, f64)>,
    /// Joints and frames an odd effect has to do with.
    pub concerns: Vec<String>,
}

#[derive(Clone, Debug)]
pub struct Answer {
    pub label: String,
    pub machine: String,
    pub mode: String,
    pub measurement: String,
    /// RMS of the noise of a reading's Euclidean norm, m or rad.
    pub noise: f64,
    pub outliers: bool,
    pub effects: Vec<Truth>,
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_string()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

impl Truth {
    fn read(value: &Value) -> Self {
        let at =
            ["frame", "axis"].iter().find_map(|k| value[*k].as_str()).unwrap_or("measurement").to_string();
        let effect = text(&value["effect"]);
        let mut also: Vec<(String, String)> = list(&value["also"])
            .iter()
            .map(|p| (text(&p[0]), p[1].as_str().unwrap_or(&at).to_string()))
            .collect();
        also.extend(list(&value["also_at"]).iter().map(|p| (effect.clone(), text(p))));
        let coefficients = value["coefficients"].as_object().into_iter().flatten();
        let mut concerns: Vec<String> = list(&value["axes"]).iter().map(text).collect();
        concerns.push(at.clone());
        Truth {
            snr: value["snr"].as_f64().unwrap_or(f64::NAN),
            coefficients: coefficients.filter_map(|(k, v)| Some((k.clone(), v.as_f64()?))).collect(),
            effect,
            at,
            also,
            concerns,
        }
    }

    /// Whether a finding says this, or what the recordings cannot tell from it.
    pub fn is(&self, finding: &Finding) -> bool {
        self.is_named(&finding.effect, &finding.at)
    }

    pub fn is_named(&self, effect: &str, at: &str) -> bool {
        self.exactly(effect, at) || self.also.iter().any(|(e, a)| e == effect && a == at)
    }

    pub fn exactly(&self, effect: &str, at: &str) -> bool {
        self.effect == effect && self.at == at
    }
}

impl Answer {
    fn read(value: &Value) -> Self {
        let machine = text(&value["machine"]);
        // The practice folder does not name the measurement: arms are measured by position there, all else by a bar.
        let three = match value["measurement"].as_str() {
            Some(m) => m == "position" || m == "pose",
            None => list(&value["tests"]).iter().any(|t| t == "poses"),
        };
        let measurement =
            value["measurement"].as_str().unwrap_or(if three { "position" } else { "distance" });
        let sigma_m = value["sigma_mm"].as_f64().unwrap_or(f64::NAN) * 1e-3;
        let angle = value["reads_angle"].as_bool() == Some(true);
        let sigma = if angle { value["sigma_rad"].as_f64().unwrap_or(f64::NAN) } else { sigma_m };
        Answer {
            label: text(&value["case"]),
            machine,
            mode: text(&value["mode"]),
            measurement: measurement.to_string(),
            noise: sigma * if three { 3f64.sqrt() } else { 1.0 },
            outliers: value["outliers"].as_f64().unwrap_or(0.0) > 0.0,
            effects: list(&value["effects"]).iter().map(Truth::read).collect(),
        }
    }
}

/// The answered cases of a folder, each with the files that a diagnosis may see.
///
/// # Errors
/// If something cannot be read.
pub fn open(folder: &Path, machines: &Path) -> Result<Vec<(CaseFiles, Answer)>, String> {
    let file = folder.join("answers.json");
    let told = |e: &dyn std::fmt::Display| format!("{}: {e}", file.display());
    let value: Value =
        serde_json::from_str(&std::fs::read_to_string(&file).map_err(|e| told(&e))?).map_err(|e| told(&e))?;
    let mut all = Vec::new();
    for answer in list(&value).iter().map(Answer::read) {
        let own = folder.join(&answer.label);
        let entries = std::fs::read_dir(&own).map_err(|e| format!("{}: {e}", own.display()))?;
        let mut recordings: Vec<_> = entries.flatten().map(|e| e.path()).collect();
        recordings.retain(|p| p.extension().is_some_and(|e| e == "csv"));
        recordings.sort();
        let path = |name: &str| {
            let file = folder.join(name).join(format!("{}.csv", answer.label));
            file.exists().then_some(file)
        };
        let files = CaseFiles {
            label: answer.label.clone(),
            machine: machines.join(format!("{}.ron", answer.machine)),
            recordings,
            judge: path("judge"),
            judge_as_is: path(AS_IS),
        };
        all.push((files, answer));
    }
    Ok(all)
}
