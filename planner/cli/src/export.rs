//! `planner export`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::plan::export::write;

use crate::choices::FormatArg;
use crate::exit::OK;

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// The plan file.
    plan: PathBuf,
    /// What is written.
    #[arg(long, value_enum)]
    format: FormatArg,
    /// Where to; without it, standard output.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(super) fn run(args: &ExportArgs) -> anyhow::Result<u8> {
    let plan = Plan::read(&args.plan)?;
    match &args.out {
        None => write(&plan, args.format.into(), &mut std::io::stdout().lock())?,
        Some(path) => {
            let context = || format!("cannot write {}", path.display());
            let mut out = BufWriter::new(File::create(path).with_context(context)?);
            write(&plan, args.format.into(), &mut out)
                .and_then(|()| out.flush())
                .with_context(context)?;
        }
    }
    Ok(OK)
}
