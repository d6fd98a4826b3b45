//! A machine, calibrated or not.

use std::path::{Path, PathBuf};

use kincal::machine::JointKind;
use kincal::{CalibratedMachine, face};
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{of_error, of_refusal, told};

/// A machine, calibrated or not.
#[pyclass(frozen, module = "kincal")]
pub struct Machine {
    pub calibrated: CalibratedMachine,
    /// The file that messages name.
    pub file: PathBuf,
}

/// Rows of numbers: one for each sample, one number for each joint.
pub type Rows = Vec<Vec<f64>>;

impl Machine {
    pub fn names(&self) -> &[String] {
        self.calibrated.machine().commands()
    }

    /// Joint positions, of one sample or of many.
    pub fn rows(&self, q: &Bound<'_, PyAny>) -> PyResult<Rows> {
        let (py, names) = (q.py(), self.names());
        let mend = || format!("give an array of shape (samples, {}): {}", names.len(), names.join(", "));
        let array = floats(q)?;
        let array = array.as_array();
        match (array.shape(), names.len()) {
            ([count], joints) if *count == joints => Ok(vec![array.iter().copied().collect()]),
            ([_, count], joints) if *count == joints => {
                Ok(array.outer_iter().map(|row| row.iter().copied().collect()).collect())
            }
            (shape, _) => Err(told(py, format!("joint positions have the shape {shape:?}"), mend())),
        }
    }
}

/// Numbers as NumPy has them; what is none is told.
pub fn floats<'py>(values: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = values.py();
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (values, "float64"));
    let array = array.and_then(|array| array.extract::<PyReadonlyArrayDyn<'py, f64>>());
    array.map_err(|error| {
        told(py, format!("an array of numbers is expected: {error}"), "give an array of floats, in SI")
    })
}

#[pymethods]
impl Machine {
    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        self.calibrated.machine().name()
    }

    /// Names of the joints that are commanded, in the order of every array of joint positions.
    #[getter]
    fn commands(&self) -> Vec<String> {
        self.names().to_vec()
    }

    /// Name, unit and travel of every commanded joint.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let machine = self.calibrated.machine();
        let joint = |(c, name): (usize, &String)| {
            let dict = PyDict::new(py);
            dict.set_item("name", name)?;
            let turns = machine.command_joint(c).kind == JointKind::Revolute;
            dict.set_item("unit", if turns { "rad" } else { "m" })?;
            dict.set_item("travel", machine.travel(c))?;
            Ok(dict)
        };
        machine.commands().iter().enumerate().map(joint).collect()
    }

    /// Poses of the tool frame in the workpiece frame.
    fn poses<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let rows = self.rows(q)?;
        let poses = py.detach(|| {
            let chain = self.calibrated.chain();
            rows.iter().flat_map(|q| matrix(&chain.w_from_t(q))).collect::<Vec<f64>>()
        });
        PyArray1::from_vec(py, poses).reshape([rows.len(), 4, 4])
    }

    /// The text of the machine file.
    fn to_ron(&self) -> String {
        self.calibrated.to_ron()
    }

    /// Writes the machine file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = std::fs::write(&path, self.calibrated.to_ron());
        written.map_err(|source| of_error(py, &kincal::Error::File { path, source }))
    }

    fn __repr__(&self) -> String {
        let samples = match self.calibrated.samples() {
            0 => String::new(),
            samples => format!(", calibrated from {samples} samples"),
        };
        format!("<kincal.Machine \"{}\": {}{samples}>", self.name(), self.names().join(", "))
    }
}

/// Row by row.
fn matrix(pose: &kincal::lie::Pose<f64>) -> [f64; 16] {
    let (r, p) = (pose.rotation.0, pose.translation.0);
    std::array::from_fn(|k| match (k / 4, k % 4) {
        (3, 3) => 1.0,
        (3, _) => 0.0,
        (i, 3) => p[i],
        (i, j) => r[i][j],
    })
}

/// Reads a machine file.
#[pyfunction]
pub fn load_machine(py: Python<'_>, path: PathBuf) -> PyResult<Machine> {
    let calibrated = face::machine(&path).map_err(|refusal| of_refusal(py, &refusal))?;
    Ok(Machine { calibrated, file: path })
}

/// Reads the text of a machine file; `name` is the file that messages name.
#[pyfunction]
#[pyo3(signature = (text, name = "machine.ron"))]
pub fn parse_machine(py: Python<'_>, text: &str, name: &str) -> PyResult<Machine> {
    let calibrated = CalibratedMachine::parse(name, text).map_err(|error| of_error(py, &error))?;
    Ok(Machine { calibrated, file: Path::new(name).to_path_buf() })
}
