//! What a program can be asked for, as it tells another program: completions and manual pages are made
//! of it without linking one into the other.

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, Command};
use serde::{Deserialize, Serialize};

/// The hidden first argument that asks a program for its description.
pub const DESCRIBE: &str = "__describe";

/// A command line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Described {
    name: String,
    about: String,
    after: String,
    args: Vec<DescribedArg>,
    below: Vec<Self>,
}

/// One of its arguments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct DescribedArg {
    id: String,
    long: Option<String>,
    short: Option<char>,
    help: String,
    values: Vec<String>,
    choices: Vec<String>,
    repeated: bool,
    global: bool,
}

impl Described {
    /// Of a command.
    #[must_use]
    pub fn of(command: &Command) -> Self {
        let shown = |arg: &&Arg| !arg.is_hide_set();
        let below = command.get_subcommands().filter(|sub| !sub.is_hide_set());
        Self {
            name: command.get_name().to_owned(),
            about: command.get_about().map(ToString::to_string).unwrap_or_default(),
            after: command.get_after_help().map(ToString::to_string).unwrap_or_default(),
            args: command.get_arguments().filter(shown).map(DescribedArg::of).collect(),
            below: below.map(Self::of).collect(),
        }
    }

    /// As text.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// From the text that a program gave.
    ///
    /// # Errors
    /// Where it is none.
    pub fn from_json(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }

    /// The subcommands.
    #[must_use]
    pub fn below(self) -> Vec<Self> {
        self.below
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What is asked for by `--NAME`.
    pub fn flags(&self) -> impl Iterator<Item = &str> {
        self.args.iter().filter_map(|arg| arg.long.as_deref())
    }

    /// A command that is described alike, under a name.
    #[must_use]
    pub fn into_command(self, name: String) -> Command {
        let mut command = Command::new(name).about(self.about).disable_help_subcommand(true);
        if !self.after.is_empty() {
            command = command.after_help(self.after);
        }
        command = command.args(self.args.into_iter().map(DescribedArg::into_arg));
        let below = self.below.into_iter().map(|sub| {
            let name = sub.name.clone();
            sub.into_command(name)
        });
        command.subcommands(below)
    }
}

impl DescribedArg {
    fn of(arg: &Arg) -> Self {
        let takes = arg.get_action().takes_values();
        let names = arg.get_value_names().unwrap_or_default();
        let choices = arg.get_possible_values();
        Self {
            id: arg.get_id().to_string(),
            long: arg.get_long().map(str::to_owned),
            short: arg.get_short(),
            help: arg.get_help().map(ToString::to_string).unwrap_or_default(),
            values: names.iter().filter(|_| takes).map(ToString::to_string).collect(),
            choices: choices.iter().filter(|_| takes).map(|c| c.get_name().to_owned()).collect(),
            repeated: matches!(arg.get_action(), ArgAction::Append | ArgAction::Count),
            global: arg.is_global_set(),
        }
    }

    fn into_arg(self) -> Arg {
        let mut arg = Arg::new(self.id).help(self.help).global(self.global);
        let is_positional = self.long.is_none() && self.short.is_none();
        if let Some(long) = self.long {
            arg = arg.long(long);
        }
        if let Some(short) = self.short {
            arg = arg.short(short);
        }
        let takes = is_positional || !self.values.is_empty() || !self.choices.is_empty();
        arg = match (takes, self.repeated) {
            (false, _) => arg.action(ArgAction::SetTrue),
            (true, false) => arg.action(ArgAction::Set),
            (true, true) => arg.action(ArgAction::Append),
        };
        if is_positional && self.repeated {
            arg = arg.num_args(0..);
        }
        if !self.values.is_empty() {
            arg = arg.value_names(self.values);
        }
        if !self.choices.is_empty() {
            let choices: Vec<_> = self.choices.into_iter().map(PossibleValue::new).collect();
            arg = arg.value_parser(choices);
        }
        arg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_makes_the_same_command_again() {
        let command = Command::new("x").about("It does x.").subcommand(
            Command::new("plan")
                .arg(Arg::new("scans").action(ArgAction::Append).value_name("SCAN"))
                .arg(Arg::new("profile").long("profile").value_parser(["slow", "fast"]))
                .arg(Arg::new("yes").short('y').long("yes").action(ArgAction::SetTrue))
                .arg(Arg::new("secret").long("secret").hide(true)),
        );
        let told = Described::of(&command);
        let read = Described::from_json(&told.to_json()).expect("a description");
        assert_eq!(read, told);
        let again = read.into_command("y".into());
        again.clone().debug_assert();
        assert_eq!(again.get_name(), "y");
        let plan = again.find_subcommand("plan").expect("a subcommand");
        let flags: Vec<_> = plan.get_arguments().filter_map(Arg::get_long).collect();
        assert_eq!(flags, ["profile", "yes"]);
        let matches =
            again.try_get_matches_from(["y", "plan", "a", "b", "--profile", "fast", "-y"]);
        assert!(matches.is_ok(), "{matches:?}");
    }
}
