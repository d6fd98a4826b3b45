//! Files of other programs that are no text, known by how they begin.
//!
//! One table says what a file is and what makes of it something that is read. Recordings, machine files and tables ask it before they read
//! a byte as text, so that nobody is told of bytes that are not UTF-8 in a file that is a workbook.

use std::path::Path;

/// As many bytes from the beginning of a file as the table needs.
pub(crate) const START: usize = 16;

/// How a bag of ROS 2 begins.
pub(crate) const MCAP: &[u8; 8] = b"\x89MCAP0\r\n";
/// How an array of NumPy begins.
pub(crate) const NUMPY: &[u8; 6] = b"\x93NUMPY";

/// A file that is no text, or text in another form than all others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Foreign {
    /// With its article.
    pub what: &'static str,
    /// What makes of it something that is read; `None` where `kincal convert` reads it.
    pub mend: Option<String>,
}

/// A row of the table.
struct Kind {
    begins: &'static [u8],
    /// Of the name, without the dot; empty where any will do.
    ending: &'static str,
    what: &'static str,
    way: Way,
}

/// What can be done with a file.
enum Way {
    /// `kincal convert` makes a recording of it.
    Convert,
    /// This makes something of it that is read; `{}` stands for its name.
    Mend(&'static str),
}

use Way::{Convert, Mend};

const BAG: Way = if cfg!(feature = "rosbag") {
    Convert
} else {
    Mend("build it with `--features rosbag`; the module for Python reads bags: `pip install ./python`")
};
const SHEET: Way = Mend("save the sheet with the table as CSV (comma or semicolon separated text)");
const EXPORT: Way = Mend("export the table that it shows as text (CSV) from the program that wrote it");

/// The first row that fits holds.
const KINDS: &[Kind] = &[
    Kind { begins: MCAP, ending: "", what: "a bag of ROS 2 (MCAP)", way: BAG },
    Kind { begins: NUMPY, ending: "", what: "an array of NumPy", way: Convert },
    Kind { begins: b"\xff\xfe", ending: "", what: "text in UTF-16", way: Convert },
    Kind { begins: b"\xfe\xff", ending: "", what: "text in UTF-16", way: Convert },
    Kind {
        begins: b"#ROSBAG V",
        ending: "",
        what: "a bag of ROS 1",
        way: Mend(
            "`rosbags-convert --src '{}' --dst NEW --dst-storage mcap` (pip install rosbags) makes a folder with an MCAP file of it",
        ),
    },
    Kind {
        begins: b"SQLite format 3\0",
        ending: "db3",
        what: "a bag of ROS 2 in SQLite",
        way: Mend(
            "`rosbags-convert --src FOLDER --dst NEW --dst-storage mcap` (pip install rosbags), or `ros2 bag convert`, makes an MCAP file of the folder that it is in",
        ),
    },
    Kind {
        begins: b"SQLite format 3\0",
        ending: "",
        what: "a database of SQLite",
        way: Mend("write its table as CSV: `sqlite3 -header -csv '{}' 'SELECT * FROM TABLE' > table.csv`"),
    },
    Kind { begins: b"PK\x03\x04", ending: "xlsx", what: "a workbook of Excel", way: SHEET },
    Kind { begins: b"PK\x03\x04", ending: "ods", what: "a spreadsheet of OpenDocument", way: SHEET },
    Kind {
        begins: b"PK\x03\x04",
        ending: "npz",
        what: "an archive of NumPy's arrays",
        way: Mend("write one of its arrays by itself: `numpy.save('array.npy', numpy.load('{}')['NAME'])`"),
    },
    Kind { begins: b"PK\x03\x04", ending: "", what: "a ZIP archive", way: Mend("unpack it: `unzip '{}'`") },
    Kind {
        begins: b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        ending: "",
        what: "a document of Microsoft Office before 2007",
        way: SHEET,
    },
    Kind {
        begins: b"\x1f\x8b",
        ending: "",
        what: "compressed by gzip",
        way: Mend("unpack it: `gunzip -k '{}'`"),
    },
    Kind {
        begins: b"\x28\xb5\x2f\xfd",
        ending: "",
        what: "compressed by zstd",
        way: Mend("unpack it: `unzstd '{}'`"),
    },
    Kind {
        begins: b"\xfd7zXZ\0",
        ending: "",
        what: "compressed by xz",
        way: Mend("unpack it: `unxz -k '{}'`"),
    },
    Kind {
        begins: b"\x89HDF\r\n\x1a\n",
        ending: "",
        what: "an HDF5 file (MATLAB writes its newer files so)",
        way: Mend(
            "write its table as CSV: `writematrix(x, 'table.csv')` in MATLAB, `numpy.savetxt('table.csv', h5py.File('{}')['NAME'], delimiter=',')` in Python",
        ),
    },
    Kind {
        begins: b"MATLAB 5.0 MAT-",
        ending: "",
        what: "a file of MATLAB",
        way: Mend(
            "write its table as CSV: `writematrix(x, 'table.csv')` in MATLAB, `numpy.savetxt('table.csv', scipy.io.loadmat('{}')['NAME'], delimiter=',')` in Python",
        ),
    },
    Kind { begins: b"TDSm", ending: "", what: "a TDMS file of LabVIEW", way: EXPORT },
    Kind { begins: b"%PDF-", ending: "", what: "a PDF document", way: EXPORT },
];

/// What a file is that begins so, if it is one of these; none of them may be read as text as it is.
pub(crate) fn of(file: &Path, start: &[u8]) -> Option<Foreign> {
    let ending = file.extension().and_then(|own| own.to_str()).unwrap_or_default();
    let fits = |kind: &&Kind| {
        start.starts_with(kind.begins) && (kind.ending.is_empty() || kind.ending.eq_ignore_ascii_case(ending))
    };
    let (what, way) = match KINDS.iter().find(fits) {
        Some(kind) => (kind.what, &kind.way),
        // No text has a byte of zero.
        None if start.iter().take(START).any(|byte| *byte == 0) => {
            ("a binary file of an unknown kind", &EXPORT)
        }
        None => return None,
    };
    let mend = match way {
        Convert => None,
        Mend(mend) => Some(mend.replace("{}", &file.display().to_string())),
    };
    Some(Foreign { what, mend })
}

/// What a folder is, where a file was to be read.
pub(crate) fn of_folder(folder: &Path) -> Foreign {
    let holds = |ending: &str| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).any(|path| path.extension().is_some_and(|own| own == ending))
    };
    match (holds("mcap"), &BAG) {
        (true, Convert) => Foreign { what: "a folder with a bag of ROS 2", mend: None },
        (true, Mend(mend)) => Foreign { what: "a folder with a bag of ROS 2", mend: Some((*mend).into()) },
        (false, _) => {
            let mend = format!("name the files in it: {}", folder.join("*.csv").display());
            Foreign { what: "a folder", mend: Some(mend) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_how_they_begin_and_none_of_them_is_text() {
        let what =
            |name: &str, start: &[u8]| of(Path::new(name), start).map(|it| (it.what, it.mend.is_some()));
        for Kind { begins, ending, what: own, way } in KINDS {
            let name = format!("a.{}", ending.to_uppercase());
            assert!(begins.len() <= START, "{own}");
            assert_eq!(what(&name, begins), Some((*own, matches!(way, Mend(_)))), "{own}");
            assert_ne!(what(&name, &begins[1..]).map(|(it, _)| it), Some(*own), "{own}");
        }
        assert_eq!(what("a.csv", b"PK\x03\x04\x14\0").map(|(it, _)| it), Some("a ZIP archive"));
        assert_eq!(what("a.csv", b"x[mm]\0"), Some(("a binary file of an unknown kind", true)));
        for text in ["", "# measurement: position", "t;x (\u{b5}m)", "Machine(", "PKW,1", "\u{feff}t,x"] {
            assert_eq!(what("a.db3", text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn a_mend_names_the_file() {
        let mend = of(Path::new("tests/a.gz"), b"\x1f\x8b\x08").and_then(|it| it.mend);
        assert_eq!(mend.as_deref(), Some("unpack it: `gunzip -k 'tests/a.gz'`"));
    }
}
