//! Two hosts as the kernel makes them: network namespaces with a wire between, on which a fifth of all
//! packets is dropped each way (nftables), and whose plug is pulled.

use std::process::Command;
use std::thread;

use super::cuts::{CUT, Road, every_plan_has_one_outcome};

const PORT: u16 = 7447;

#[test]
fn every_plan_has_one_outcome_between_namespaces() {
    match Namespaces::new() {
        Ok(road) => every_plan_has_one_outcome(&road),
        Err(why) => eprintln!(
            "not run, no network namespaces with a lossy wire between can be had: {why}. It takes root, \
             ip (iproute2) and nft (nftables); the test with a proxy on loopback takes none of them"
        ),
    }
}

/// Two namespaces, the robot's first, with a wire between.
struct Namespaces([String; 2]);

/// Their addresses.
const HOSTS: [&str; 2] = ["10.77.0.1", "10.77.0.2"];

impl Namespaces {
    fn new() -> Result<Self, String> {
        let names =
            ["robot", "planner"].map(|end| format!("nullsweep-{end}-{}", std::process::id()));
        for name in &names {
            run(&format!("ip netns add {name}"))?;
        }
        let road = Self(names);
        let [robot, planner] = &road.0;
        run(&format!("ip link add wire netns {robot} type veth peer name wire netns {planner}"))?;
        for (name, address) in road.0.iter().zip(HOSTS) {
            run(&format!("ip -n {name} address add {address}/24 dev wire"))?;
            run(&format!("ip -n {name} link set wire up"))?;
            for rule in [
                "table ip lossy",
                "chain ip lossy in { type filter hook input priority 0 ; }",
                "rule ip lossy in counter",
                "rule ip lossy in numgen random mod 5 == 0 counter drop",
            ] {
                run(&format!("ip netns exec {name} nft add {rule}"))?;
            }
        }
        Ok(road)
    }

    fn wire(&self, state: &str) {
        run(&format!("ip -n {} link set wire {state}", self.0[0])).unwrap();
    }

    fn program(&self, host: usize) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.0[host], env!("CARGO_BIN_EXE_relay")]);
        command
    }
}

impl Road for Namespaces {
    fn listens(&self) -> String {
        format!("tcp/{}:{PORT}", HOSTS[0])
    }

    fn connects(&self) -> String {
        self.listens()
    }

    fn robot(&self) -> Command {
        self.program(0)
    }

    fn planner(&self) -> Command {
        self.program(1)
    }

    /// On a wire nobody is told.
    fn cut(&self, _silent: bool) {
        self.wire("down");
        thread::sleep(CUT);
        self.wire("up");
    }

    fn lost(&self) -> (u64, u64) {
        let (mut came, mut lost) = (0, 0);
        for name in &self.0 {
            let rules = run(&format!("ip netns exec {name} nft list chain ip lossy in")).unwrap();
            let counts = rules.split("packets ").skip(1);
            let mut counts =
                counts.map(|rest| rest.split(' ').next().unwrap().parse::<u64>().unwrap());
            came += counts.next().unwrap();
            lost += counts.next().unwrap();
        }
        (came, lost)
    }
}

impl Drop for Namespaces {
    fn drop(&mut self) {
        for name in &self.0 {
            let _ = run(&format!("ip netns del {name}"));
        }
    }
}

/// What a command prints; else what it says.
fn run(line: &str) -> Result<String, String> {
    let mut words = line.split(' ');
    let done = Command::new(words.next().unwrap()).args(words).output();
    let done = done.map_err(|error| format!("{line}: {error}"))?;
    if !done.status.success() {
        return Err(format!("{line}: {}", String::from_utf8_lossy(&done.stderr).trim()));
    }
    Ok(String::from_utf8_lossy(&done.stdout).into_owned())
}
