//! A cell as defaults of flags.

use std::ffi::{OsStr, OsString};

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

use crate::file::Cell;

/// Every flag that a cell may give.
pub const FLAGS: [&str; 25] = [
    "robot-name",
    "ipc-root",
    "urdf",
    "arm",
    "tool",
    "srdf",
    "fit-capsules",
    "v-max",
    "profile",
    "base",
    "up",
    "sensor-height",
    "support-height",
    "table",
    "unseen",
    "scale",
    "rate",
    "cpu",
    "priority",
    "record",
    "start",
    "initial",
    // Of these each value has a name, NAME=VALUE.
    NAMED[0],
    NAMED[1],
    NAMED[2],
];

/// Flags whose values have names: what is given adds to what a cell has, and wins by the name.
const NAMED: [&str; 3] = ["package", "held", "posture"];

/// Values of flags by their long names; one that may be repeated has several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defaults(Vec<(&'static str, Vec<OsString>)>);

impl From<&Cell> for Defaults {
    fn from(cell: &Cell) -> Self {
        let mut all = Vec::new();
        let mut put = |flag, value: Option<OsString>| all.extend(value.map(|v| (flag, vec![v])));
        let number = |v: Option<f64>| v.map(|v| v.to_string().into());
        let text = |v: &Option<String>| v.clone().map(OsString::from);
        let path = |v: &Option<std::path::PathBuf>| v.clone().map(OsString::from);
        put("robot-name", text(&cell.robot));
        put("ipc-root", path(&cell.ipc_root));
        put("urdf", path(&cell.urdf));
        put("arm", text(&cell.arm));
        put("tool", path(&cell.tool));
        put("srdf", path(&cell.srdf));
        put("fit-capsules", number(cell.fit_capsules));
        put("v-max", number(cell.limits.v_max));
        put("profile", text(&cell.limits.profile));
        let scene = &cell.scene;
        put("base", scene.base.as_ref().map(|v| list(v, ",")));
        put("up", scene.up.map(|v| list(&v, ",")));
        put("sensor-height", number(scene.sensor_height));
        put("support-height", number(scene.support_height));
        put("table", scene.table.map(|v| list(&v, "x")));
        put("unseen", text(&scene.unseen));
        put("scale", number(scene.scale));
        let executor = &cell.executor;
        put("rate", executor.rate.map(|v| v.to_string().into()));
        put("cpu", executor.cpu.map(|v| v.to_string().into()));
        put("priority", executor.priority.map(|v| v.to_string().into()));
        put("record", path(&executor.record));
        // Plans begin where the arm stands at first.
        let begin =
            ["start", "home"].into_iter().find_map(|name| cell.postures.get_key_value(name));
        put("start", begin.map(|(name, _)| name.into()));
        put("initial", begin.map(|(_, joints)| list(joints, ",")));
        let mut many = |flag, values: Vec<OsString>| {
            if !values.is_empty() {
                all.push((flag, values));
            }
        };
        let pair = |name: &str, value: OsString| {
            let mut pair = OsString::from(format!("{name}="));
            pair.push(value);
            pair
        };
        many("package", cell.packages.iter().map(|(n, v)| pair(n, v.into())).collect());
        many("held", cell.held.iter().map(|(n, v)| pair(n, v.to_string().into())).collect());
        many("posture", cell.postures.iter().map(|(n, v)| pair(n, list(v, ","))).collect());
        Self(all)
    }
}

fn list(values: &[f64], between: &str) -> OsString {
    let values: Vec<String> = values.iter().map(f64::to_string).collect();
    values.join(between).into()
}

impl Defaults {
    /// The same without some flags.
    #[must_use]
    pub fn without(&self, flags: &[&str]) -> Self {
        Self(self.0.iter().filter(|(flag, _)| !flags.contains(flag)).cloned().collect())
    }

    /// Whether an argument has one.
    pub(crate) fn has(&self, arg: &Arg) -> bool {
        self.of(arg).is_some()
    }

    fn of(&self, arg: &Arg) -> Option<&[OsString]> {
        let long = arg.get_long()?;
        self.0.iter().find(|(flag, _)| *flag == long).map(|(_, values)| &values[..])
    }

    /// What of the named values stands beside those that the command line gives, as flags, and the
    /// subcommands that it is to be given to.
    pub(crate) fn beside<'a>(
        &self,
        command: &'a Command,
        matches: &'a ArgMatches,
    ) -> (Vec<&'a str>, Vec<OsString>) {
        if let Some((name, matches)) = matches.subcommand()
            && let Some(command) = command.find_subcommand(name)
        {
            let (mut path, flags) = self.beside(command, matches);
            path.insert(0, name);
            return (path, flags);
        }
        let name = |value: &OsStr| {
            let text = value.to_string_lossy();
            text.split_once('=')
                .map_or_else(|| text.to_lowercase(), |(name, _)| name.to_lowercase())
        };
        let mut flags = Vec::new();
        for arg in command.get_arguments() {
            let (Some(long), id) = (arg.get_long(), arg.get_id().as_str()) else { continue };
            // What the cell was kept from giving here has no default.
            let is_open = NAMED.contains(&long) && !arg.get_default_values().is_empty();
            if !is_open || matches.value_source(id) != Some(ValueSource::CommandLine) {
                continue;
            }
            let given: Vec<String> = matches.get_raw(id).into_iter().flatten().map(name).collect();
            for value in self.of(arg).unwrap_or_default() {
                if !given.contains(&name(value)) {
                    let mut flag = OsString::from(format!("--{long}="));
                    flag.push(value);
                    flags.push(flag);
                }
            }
        }
        (Vec::new(), flags)
    }

    /// Puts them into a command and all below it. `apart`: subcommands that go without some.
    pub(crate) fn furnish(&self, mut command: Command, apart: &[(&str, &[&str])]) -> Command {
        let given: Vec<_> = command
            .get_arguments()
            .filter_map(|arg| Some((arg.get_id().clone(), self.of(arg)?.to_vec())))
            .collect();
        for (id, values) in given {
            command = command.mut_arg(id, |arg| arg.default_values(values));
        }
        let below: Vec<String> =
            command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
        for name in below {
            let without = apart.iter().find(|(sub, _)| *sub == name).map_or(&[][..], |(_, f)| f);
            let own = self.without(without);
            command = command.mut_subcommand(name, |sub| own.furnish(sub, apart));
        }
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_that_a_cell_gives_is_listed() {
        let all = "robot = \"a\"\nipc_root = \"b\"\nurdf = \"c\"\narm = \"d,e\"\ntool = \"f\"\n\
            srdf = \"g\"\nfit_capsules = 0.05\nendpoint = [\"h\"]\n[packages]\ni = \"j\"\n\
            [held]\nk = 0.1\n[postures]\nhome = [0]\n[limits]\nv_max = 1\nprofile = \"velocity\"\n\
            [scene]\nbase = [0, 0, 0]\nup = [0, 0, 1]\nsensor_height = 1\nsupport_height = 1\n\
            table = [1, 1]\nunseen = \"free\"\nscale = 1\n\
            [executor]\nrate = 1000\ncpu = 1\npriority = 5\nrecord = \"l\"\n";
        let cell: Cell = toml::from_str(all).expect("a cell");
        let mut given: Vec<&str> = Defaults::from(&cell).0.iter().map(|(flag, _)| *flag).collect();
        let mut listed = FLAGS.to_vec();
        given.sort_unstable();
        listed.sort_unstable();
        assert_eq!(given, listed);
    }
}
