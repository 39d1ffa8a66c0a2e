//! Writes what a fuzzer begins with, a folder for each target: `seeds FOLDER`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use nullsweep_inputs::TARGETS;

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("seeds: a folder is wanted");
        return ExitCode::from(2);
    };
    match write(&folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("seeds: {}: {error}", folder.display());
            ExitCode::FAILURE
        }
    }
}

fn write(folder: &Path) -> std::io::Result<()> {
    for target in TARGETS {
        let own = folder.join(target.name);
        std::fs::create_dir_all(&own)?;
        for (k, seed) in (target.made)().into_iter().enumerate() {
            std::fs::write(own.join(format!("made-{k}")), seed)?;
        }
        for entry in std::fs::read_dir(target.corpus()).into_iter().flatten() {
            let entry = entry?;
            std::fs::copy(entry.path(), own.join(entry.file_name()))?;
        }
    }
    Ok(())
}
