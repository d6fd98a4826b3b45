//! Recordings: files, or columns of arrays that read as a file with the same columns would.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use kincal::recording::RecordingFault;
use kincal::{Machine, Place, face};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyMapping;

use crate::failure::{of_error, of_refusal, told};
use crate::machine::floats;

/// A recording of arrays, held as the text of its file.
#[pyclass(frozen, module = "kincal")]
pub struct Recording {
    name: String,
    text: String,
    rows: usize,
}

/// What stands behind a key of the head.
enum Value {
    Text(String),
    Number(f64),
    Numbers(Vec<f64>),
}

impl<'a, 'py> FromPyObject<'a, 'py> for Value {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(text) = value.extract() {
            return Ok(Value::Text(text));
        }
        if let Ok(number) = value.extract() {
            return Ok(Value::Number(number));
        }
        let numbers = value.extract().map(Value::Numbers);
        numbers.map_err(|_| PyTypeError::new_err("a header key takes a text, a number, or several numbers"))
    }
}

impl Value {
    fn text(&self) -> String {
        match self {
            Value::Text(text) => text.clone(),
            Value::Number(number) => format!("{number:?}"),
            Value::Numbers(numbers) => {
                numbers.iter().map(|number| format!("{number:?}")).collect::<Vec<_>>().join(", ")
            }
        }
    }
}

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (columns, head, name = "arrays"))]
    fn new(
        py: Python<'_>,
        columns: &Bound<'_, PyMapping>,
        head: &Bound<'_, PyMapping>,
        name: &str,
    ) -> PyResult<Self> {
        if name.contains(['\n', '\r', '\0']) {
            return Err(told(py, format!("name {name:?} has a line break"), "give it a name in one line"));
        }
        if columns.is_empty()? {
            let mend = "give an array for each joint and for what was measured, such as x[mm] and px[mm]";
            return Err(told(py, format!("{name}: no column is given"), mend));
        }
        let mut text = String::new();
        for item in head.items()? {
            let (key, value) = item.extract::<(String, Value)>()?;
            let value = value.text();
            if [&key, &value].iter().any(|part| part.contains(['\n', '\r'])) {
                let what = format!("{name}: header key {key:?} has a line break");
                return Err(told(py, what, "write it in one line"));
            }
            let _ = writeln!(text, "# {key}: {value}");
        }
        let mut all: Vec<(String, Vec<f64>)> = Vec::new();
        for item in columns.items()? {
            let (column, values) = item.extract::<(String, Bound<'_, PyAny>)>()?;
            if column.contains([',', '"', '\n', '\r']) {
                let what = format!(
                    "{name}: column {column:?} has a comma, a quotation mark or a line break in its name"
                );
                return Err(told(py, what, "give it a name without"));
            }
            let array = floats(&values)?;
            let array = array.as_array();
            if array.ndim() != 1 {
                let what = format!("{name}: column `{column}` has the shape {:?}", array.shape());
                return Err(told(
                    py,
                    what,
                    "give a column for each number of a sample, such as px[m], py[m], pz[m]",
                ));
            }
            all.push((column, array.iter().copied().collect()));
        }
        let rows = all.first().map_or(0, |(_, values)| values.len());
        if let Some((column, values)) = all.iter().find(|(_, values)| values.len() != rows) {
            let (column, first) = (column.clone(), all[0].0.clone());
            let fault = RecordingFault::UnequalArrays { column, values: values.len(), first, samples: rows };
            let error = kincal::Error::Input { place: Place::file(name), fault: Box::new(fault) };
            return Err(of_error(py, &error));
        }
        py.detach(|| {
            let names: Vec<&str> = all.iter().map(|(column, _)| column.as_str()).collect();
            let _ = writeln!(text, "{}", names.join(","));
            for k in 0..rows {
                for (c, (_, values)) in all.iter().enumerate() {
                    // The shortest decimals that are read as the same number.
                    let _ = write!(text, "{}{:?}", if c > 0 { "," } else { "" }, values[k]);
                }
                text.push('\n');
            }
        });
        Ok(Recording { name: name.to_string(), text, rows })
    }

    /// What stands for it in messages and results.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The text of the file that it reads as.
    fn to_csv(&self) -> &str {
        &self.text
    }

    /// Writes that file; in columns where its name says so.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let bytes = kincal::recording::bytes_of(&path, &self.text).map_err(|error| of_error(py, &error))?;
        let written = std::fs::write(&path, bytes);
        written.map_err(|source| of_error(py, &kincal::Error::File { path, source }))
    }

    fn __len__(&self) -> usize {
        self.rows
    }

    fn __repr__(&self) -> String {
        format!("<kincal.Recording \"{}\": {} rows>", self.name, self.rows)
    }
}

/// A recording as a function takes it.
pub enum Given {
    Arrays(Py<Recording>),
    Path(PathBuf),
}

impl<'a, 'py> FromPyObject<'a, 'py> for Given {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(arrays) = value.cast::<Recording>() {
            return Ok(Given::Arrays(arrays.to_owned().unbind()));
        }
        let path = value.extract().map(Given::Path);
        path.map_err(|_| PyTypeError::new_err("a recording is the path of a file, or a kincal.Recording"))
    }
}

/// One recording or several.
pub enum AllGiven {
    One(Given),
    Several(Vec<Given>),
}

impl<'a, 'py> FromPyObject<'a, 'py> for AllGiven {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        match value.extract() {
            Ok(one) => Ok(AllGiven::One(one)),
            // What is no sequence is told as what it is not: a recording.
            Err(error) => match value.try_iter() {
                Ok(several) => {
                    several.map(|one| one?.extract()).collect::<PyResult<_>>().map(AllGiven::Several)
                }
                Err(_) => Err(error),
            },
        }
    }
}

/// What is to be opened, apart from Python: paths, and names with texts.
pub struct Sources {
    paths: Vec<PathBuf>,
    arrays: Vec<(String, String)>,
}

impl Sources {
    pub fn of(given: AllGiven) -> Self {
        let given = match given {
            AllGiven::One(given) => vec![given],
            AllGiven::Several(several) => several,
        };
        let mut sources = Sources { paths: Vec::new(), arrays: Vec::new() };
        for given in given {
            match given {
                Given::Path(path) => sources.paths.push(path),
                Given::Arrays(arrays) => {
                    let arrays = arrays.get();
                    sources.arrays.push((arrays.name.clone(), arrays.text.clone()));
                }
            }
        }
        sources
    }

    /// Files first, then arrays.
    pub fn open(self, machine: &Machine, file: &Path) -> Result<Vec<kincal::Recording>, face::Refusal> {
        let mut recordings = match self.paths.is_empty() {
            true => Vec::new(),
            false => face::recordings(&self.paths, machine, file)?,
        };
        for (name, text) in self.arrays {
            recordings.push(kincal::Recording::from_bytes(&name, text.into_bytes(), machine)?);
        }
        if recordings.is_empty() {
            return Err(face::Refusal::Refused {
                what: "no recording is given".into(),
                mend: "give the path of a file, a kincal.Recording, or a list of them".into(),
            });
        }
        Ok(recordings)
    }
}

/// Without holding Python up.
pub fn detached<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, face::Refusal> + Send,
) -> PyResult<T> {
    py.detach(work).map_err(|refusal| of_refusal(py, &refusal))
}
