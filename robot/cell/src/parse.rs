//! A program's arguments, with a cell file's values where they say nothing.

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::ops::Range;
use std::path::PathBuf;

use clap::builder::StyledStr;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, Error, Parser};

use crate::causes::causes;
use crate::defaults::Defaults;
use crate::describe::{DESCRIBE, Described};
use crate::file::{Cell, FILE_NAME};
use crate::front::as_called;

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
    let command = in_its_words(P::command()).max_term_width(WIDTH).arg(cell_argument());
    describe(&args, &command);
    let given = given(&args).map(|(_, path)| path).or_else(variable);
    let is_given = given.is_some();
    let Some(path) = chosen(given) else {
        let mut matches = command.try_get_matches_from(args)?;
        return P::from_arg_matches_mut(&mut matches);
    };
    let cell = match Cell::read(&path) {
        Ok(cell) => cell,
        Err(why) if is_urgent(&args, urgent) => {
            say(&format!("warning: {why}; what it says is not heeded"));
            Cell::default()
        }
        Err(why) => {
            let text = format!("{}\n", causes(&why));
            return Err(Error::raw(ErrorKind::ValueValidation, text));
        }
    };
    let own = apart.iter().find(|(sub, _)| sub.is_empty()).map_or(&[][..], |(_, flags)| flags);
    let defaults = Defaults::from(&cell).without(own);
    let mut furnished = defaults.furnish(command, apart);
    let mut matches = furnished.try_get_matches_from_mut(&args)?;
    let (path_to, beside) = defaults.beside(&furnished, &matches);
    let adds = !beside.is_empty();
    if adds {
        let args = inserted(args, &path_to, beside);
        matches = furnished.try_get_matches_from_mut(args)?;
    }
    if !is_given && (adds || is_used(&defaults, &furnished, &matches)) {
        say(&format!("note: what is not given is taken from {}", path.display()));
    }
    P::from_arg_matches_mut(&mut matches)
}

/// Whether the subcommand is one of those: the first word that is no flag, nor the value of one that
/// takes it apart.
fn is_urgent(args: &[OsString], urgent: &[&str]) -> bool {
    let mut rest = args.iter().skip(1);
    while let Some(arg) = rest.next() {
        if arg == "--cell" {
            rest.next();
        } else if !arg.as_encoded_bytes().starts_with(b"-") {
            return urgent.iter().any(|name| arg == name);
        }
    }
    false
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
    let command = in_its_words(P::command()).max_term_width(WIDTH);
    describe(&args, &command);
    P::from_arg_matches_mut(&mut command.try_get_matches_from(args)?)
}

/// A command whose help speaks of the programs as its reader calls them.
fn in_its_words(mut command: Command) -> Command {
    let said = |text: Option<&StyledStr>| text.map(|text| as_called(text.to_string()));
    if let Some(about) = said(command.get_about()) {
        command = command.about(about);
    }
    if let Some(about) = said(command.get_long_about()) {
        command = command.long_about(about);
    }
    if let Some(help) = said(command.get_after_help()) {
        command = command.after_help(help);
    }
    let in_words = |mut arg: Arg| {
        if let Some(help) = said(arg.get_help()) {
            arg = arg.help(help);
        }
        if let Some(help) = said(arg.get_long_help()) {
            arg = arg.long_help(help);
        }
        arg
    };
    command.mut_args(in_words).mut_subcommands(in_its_words)
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

/// Where among the arguments a file is named, and the file.
fn given(args: &[OsString]) -> Option<(Range<usize>, PathBuf)> {
    let end = args.iter().position(|arg| arg == "--").unwrap_or(args.len());
    args[..end].iter().enumerate().find_map(|(i, arg)| {
        if arg == "--cell" {
            return Some((i..i + 2, args.get(i + 1)?.into()));
        }
        let path = arg.to_str()?.strip_prefix("--cell=")?;
        Some((i..i + 1, path.into()))
    })
}

/// The file that [`VARIABLE`] names.
fn variable() -> Option<PathBuf> {
    std::env::var_os(VARIABLE).map(PathBuf::from)
}

/// The file that was given, where it is not empty; without one, the nearest.
fn chosen(given: Option<PathBuf>) -> Option<PathBuf> {
    let found = || Cell::find(&std::env::current_dir().ok()?);
    given.or_else(found).filter(|path| !path.as_os_str().is_empty())
}

/// The cell file as [`parse`] takes it, for a program that passes its arguments on: what names it among
/// them is taken out.
pub fn take(args: &mut Vec<OsString>) -> Option<PathBuf> {
    let named = given(args).map(|(at, path)| {
        args.drain(at);
        path
    });
    chosen(named.or_else(variable))
}

/// A command line with flags of a subcommand put behind its name.
fn inserted(mut args: Vec<OsString>, path: &[&str], flags: Vec<OsString>) -> Vec<OsString> {
    let mut at = 1;
    for name in path {
        while at < args.len() && args[at] != *name {
            at += if args[at] == "--cell" { 2 } else { 1 };
        }
        at += 1;
    }
    let at = at.min(args.len());
    args.splice(at..at, flags);
    args
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

    /// Stopping an arm is kept from nothing, wherever the cell's name stands.
    #[test]
    fn a_broken_cell_keeps_no_urgent_command() {
        let folder = tempfile::tempdir().expect("a folder");
        let broken = folder.path().join("broken.toml");
        std::fs::write(&broken, "arm = [").expect("written");
        let path = broken.to_str().expect("UTF-8");
        let one = format!("--cell={path}");
        let judge = |args: &[&str]| parse::<Cli>(args, &[], &["replan"]).map(|c| c.command);
        for args in [
            &["x", "replan", "--cell", path][..],
            &["x", "--cell", path, "replan"],
            &["x", &one, "replan"],
        ] {
            assert!(matches!(judge(args), Ok(Sub::Replan { base: None })), "{args:?}");
        }
        for args in
            [&["x", "--cell", path, "plan"][..], &["x", "plan", "--posture", "replan", &one]]
        {
            assert_eq!(judge(args).unwrap_err().kind(), ErrorKind::ValueValidation, "{args:?}");
        }
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
        assert_eq!(arm, "base_link,tool_tip");
        assert_eq!(posture, ["home=0,-1.5", "start=0.5,0.25", "a=1"]);
        let own = ["plan", "--posture", "a=1", "--posture=Home=7", "--arm", "plan"];
        let Ok(Sub::Plan { posture, .. }) = with(folder.path(), &own) else { panic!("sound") };
        assert_eq!(posture, ["start=0.5,0.25", "a=1", "Home=7"], "given wins by the name");
        let Ok(Sub::Replan { base: None }) = with(folder.path(), &["replan"]) else {
            panic!("it goes without");
        };
    }

    #[test]
    fn what_names_a_cell_is_taken_out_of_arguments_that_are_passed_on() {
        for words in [&["--wrap", "--cell", "a.toml", "-x"][..], &["--cell=a.toml", "--wrap", "-x"]]
        {
            let mut args: Vec<OsString> = words.iter().map(Into::into).collect();
            assert_eq!(take(&mut args), Some("a.toml".into()));
            assert_eq!(args, ["--wrap", "-x"]);
        }
        let mut args: Vec<OsString> = ["--", "--cell", "a.toml"].map(Into::into).into();
        let _ = take(&mut args);
        assert_eq!(args.len(), 3, "what stands behind -- is not ours");
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
