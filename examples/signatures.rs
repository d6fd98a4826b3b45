//! Draws what every family of the library does to the trace of a ballbar, into `docs/effects/`:
//!
//! ```text
//! cargo run --release --features measure --example signatures
//! ```

#[path = "../tests/signatures/mod.rs"]
mod signatures;

use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/effects");
    std::fs::create_dir_all(&folder)?;
    let drawn = signatures::draw(&kincal::effects::Library::standard());
    for entry in std::fs::read_dir(&folder)? {
        let path = entry?.path();
        // What belongs to a family that is no more goes with it.
        if path.extension().is_some_and(|e| e == "svg")
            && !drawn.iter().any(|own| folder.join(&own.file) == path)
        {
            std::fs::remove_file(path)?;
        }
    }
    for own in &drawn {
        std::fs::write(folder.join(&own.file), &own.text)?;
    }
    let bytes: usize = drawn.iter().map(|own| own.text.len()).sum();
    println!("{} files, {} kB, in {}", drawn.len(), bytes / 1000, folder.display());
    Ok(())
}
