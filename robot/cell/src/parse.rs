//! A program's arguments, with a cell file's values where they say nothing.

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, Error, Parser};

use crate::causes::causes;
use crate::defaults::Defaults;
use crate::describe::{DESCRIBE, Described};
use crate::file::{Cell, FILE_NAME};

/// Names the cell file where `--cell` does not; empty: there is none.
pub const VARIABLE: &str = "NULLSWEEP_CELL";

/// Columns that help takes at most.
const WIDTH: usize = 80;

/// Parses a command line, program name first. Flags that it leaves out are taken from the cell file
/// that `--cell` or [`VARIABLE`] names, or the nearest one in the working folder and above; the
/// latter is told on standard error. `apart`: subcommands that take some flags from no cell; `urgent`:
/// those that a cell file which cannot be used keeps from nothing, as stopping an arm.
///
/// # Errors
/// As [`Parser::try_parse_from`], help and version included; a cell file that cannot be used.
pub fn parse<P: Parser>(
    args: impl IntoIterator<Item = impl Into<OsString>>,
    apart: &[(&str, &[&str])],
    urgent: &[&str],
) -> Result<P, Error> {
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let command = P::command().max_term_width(WIDTH).arg(cell_argument());
    describe(&args, &command);
    let given = given(&args).or_else(|| std::env::var_os(VARIABLE).map(PathBuf::from));
    let found = || std::env::current_dir().ok().and_then(|folder| Cell::find(&folder));
    let path = given.clone().or_else(found).filter(|path| !path.as_os_str().is_empty());
    let Some(path) = path else {
        let mut matches = command.try_get_matches_from(args)?;
        return P::from_arg_matches_mut(&mut matches);
    };
    let cell = match Cell::read(&path) {
        Ok(cell) => cell,
        Err(why) if args.get(1).is_some_and(|arg| urgent.iter().any(|name| arg == name)) => {
            say(&format!("warning: {why}; what it says is not heeded"));
            Cell::default()
        }
        Err(why) => {
            let text = format!("{}\n", causes(&why));
            return Err(Error::raw(ErrorKind::ValueValidation, text));
        }
    };
    let defaults = Defaults::from(&cell);
    let mut furnished = defaults.furnish(command, apart);
    let mut matches = furnished.try_get_matches_from_mut(args)?;
    if given.is_none() && is_used(&defaults, &furnished, &matches) {
        say(&format!("note: what is not given is taken from {}", path.display()));
    }
    P::from_arg_matches_mut(&mut matches)
}

/// Says something on standard error; nobody need hear it.
fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// As [`parse`], for a program that has nothing to do with a cell.
///
/// # Errors
/// As [`Parser::try_parse_from`].
pub fn parse_alone<P: Parser>(
    args: impl IntoIterator<Item = impl Into<OsString>>,
) -> Result<P, Error> {
    let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
    let command = P::command().max_term_width(WIDTH);
    describe(&args, &command);
    P::from_arg_matches_mut(&mut command.try_get_matches_from(args)?)
}

/// Where it is asked for, writes the description and ends the process.
fn describe(args: &[OsString], command: &Command) {
    if args.get(1).is_some_and(|arg| arg == DESCRIBE) {
        // Whoever asked and reads no more has what it wants.
        let _ = writeln!(std::io::stdout(), "{}", Described::of(command).to_json());
        std::process::exit(0);
    }
}

fn cell_argument() -> Arg {
    let help = format!(
        "Take what is not given from this file; else from the nearest {FILE_NAME} in the working folder \
         or above"
    );
    Arg::new("cell").long("cell").value_name("FILE").global(true).help(help)
}

/// The file that the arguments name.
fn given(args: &[OsString]) -> Option<PathBuf> {
    let mut args = args.iter().take_while(|arg| *arg != "--");
    while let Some(arg) = args.next() {
        if arg == "--cell" {
            return args.next().map(PathBuf::from);
        }
        if let Some(path) = arg.to_str().and_then(|arg| arg.strip_prefix("--cell=")) {
            return Some(path.into());
        }
    }
    None
}

/// Whether any value was taken from the cell.
fn is_used(defaults: &Defaults, command: &Command, matches: &ArgMatches) -> bool {
    let own = command.get_arguments().filter(|arg| defaults.has(arg)).any(|arg| {
        let id = arg.get_id().as_str();
        matches.try_contains_id(id).unwrap_or(false)
            && matches.value_source(id) == Some(ValueSource::DefaultValue)
    });
    let below = matches.subcommand().and_then(|(name, matches)| {
        let command = command.find_subcommand(OsStr::new(name))?;
        Some(is_used(defaults, command, matches))
    });
    own || below.unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[derive(Debug, Parser)]
    struct Cli {
        #[command(subcommand)]
        command: Sub,
    }

    #[derive(Debug, clap::Subcommand)]
    enum Sub {
        Plan {
            #[arg(long)]
            urdf: Option<PathBuf>,
            #[arg(long, default_value = "right")]
            arm: String,
            #[arg(long, value_parser = clap::value_parser!(f64))]
            v_max: Option<f64>,
            #[arg(long, allow_hyphen_values = true)]
            base: Option<String>,
            #[arg(long)]
            posture: Vec<String>,
            #[arg(long, conflicts_with = "base")]
            free: bool,
        },
        Replan {
            #[arg(long)]
            base: Option<String>,
        },
    }

    const CELL: &str = "urdf = \"arms/ur5.urdf\"\narm = \"base_link,tool_tip\"\n\
        [postures]\nhome = [0, -1.5]\nstart = [0.5, 0.25]\n[limits]\nv_max = 0.8\n\
        [scene]\nbase = [-0.7, 0, 1.5]\n";

    fn with(folder: &Path, args: &[&str]) -> Result<Sub, Error> {
        let path = folder.join("own.toml");
        std::fs::write(&path, CELL).expect("written");
        let cell = ["--cell", path.to_str().expect("UTF-8")];
        parse::<Cli>([&["x"], args, &cell].concat(), &[("replan", &["base"])], &[])
            .map(|c| c.command)
    }

    #[test]
    fn a_cell_gives_what_flags_leave_out_and_flags_win() {
        let folder = tempfile::tempdir().expect("a folder");
        let Ok(Sub::Plan { urdf, arm, v_max, base, posture, free }) =
            with(folder.path(), &["plan", "--arm", "left", "--free"])
        else {
            panic!("what is not given conflicts with nothing");
        };
        assert_eq!(urdf, Some(folder.path().join("arms/ur5.urdf")));
        assert_eq!((arm.as_str(), v_max, free), ("left", Some(0.8), true));
        assert_eq!(base.as_deref(), Some("-0.7,0,1.5"));
        assert_eq!(posture, ["home=0,-1.5", "start=0.5,0.25"]);
        let own = ["plan", "--posture", "a=1"];
        let Ok(Sub::Plan { arm, posture, .. }) = with(folder.path(), &own) else { panic!("sound") };
        assert_eq!((arm.as_str(), &posture[..]), ("base_link,tool_tip", &["a=1".to_owned()][..]));
        let Ok(Sub::Replan { base: None }) = with(folder.path(), &["replan"]) else {
            panic!("it goes without");
        };
    }

    #[test]
    fn a_cell_is_found_above_and_a_broken_one_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let deep = folder.path().join("a/b");
        std::fs::create_dir_all(&deep).expect("folders");
        let path = folder.path().join(FILE_NAME);
        std::fs::write(&path, CELL).expect("written");
        assert_eq!(Cell::find(&deep), Some(path.clone()));
        std::fs::write(&path, "robot = \"a\"\nurfd = \"b\"\n").expect("written");
        let error = Cell::read(&path).expect_err("misspelt").to_string();
        assert!(error.contains("cell.toml") && error.contains("urfd"), "{error}");
        let args = ["x", "plan", "--cell", path.to_str().expect("UTF-8")];
        let error = parse::<Cli>(args, &[], &[]).expect_err("misspelt");
        assert!(error.use_stderr() && error.to_string().contains("line 2"), "{error}");
        // What cannot wait goes on without.
        let args = ["x", "replan", "--cell", path.to_str().expect("UTF-8")];
        assert!(parse::<Cli>(args, &[], &["plan"]).is_err());
        let Ok(Cli { command: Sub::Replan { base: None } }) = parse::<Cli>(args, &[], &["replan"])
        else {
            panic!("it goes on");
        };
    }
}
