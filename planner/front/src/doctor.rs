//! What this machine lacks, each with the line that mends it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use nullsweep_cell::beside;
use rustix::process::{Resource, getrlimit};

use crate::out::write_out;
use crate::programs::{EXECUTOR, PLANNER, whole};

/// What was looked at.
#[derive(Debug, PartialEq)]
struct Finding {
    name: &'static str,
    /// What is there.
    found: String,
    /// What to do, where something is amiss.
    mend: Option<String>,
}

impl Finding {
    fn good(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, found: found.into(), mend: None }
    }

    fn poor(name: &'static str, found: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { name, found: found.into(), mend: Some(mend.into()) }
    }
}

/// Looks, and tells. Nothing of it keeps the executor from running: it runs as well as it may.
pub(crate) fn run() -> anyhow::Result<ExitCode> {
    let found = [
        kernel(&read("/proc/version"), Path::new("/sys/kernel/realtime").exists()),
        priority(getrlimit(Resource::Rtprio).current),
        memory(getrlimit(Resource::Memlock).current),
        governor(&governors(Path::new("/sys/devices/system/cpu"))),
        shared_memory(Path::new("/dev/shm")),
        leftovers(Path::new("/dev/shm")),
        versions(),
    ];
    write_out(told(&found).as_bytes())
}

fn told(found: &[Finding]) -> String {
    let mut text = String::new();
    for Finding { name, found, mend } in found {
        let mark = if mend.is_some() { "poor" } else { "good" };
        let _ = writeln!(text, "{mark}  {name:<13} {found}");
        if let Some(mend) = mend {
            let _ = writeln!(text, "      {mend}");
        }
    }
    text
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

fn kernel(version: &str, realtime: bool) -> Finding {
    let release = version.split_whitespace().nth(2).unwrap_or("unknown").to_owned();
    if realtime || version.contains("PREEMPT_RT") {
        return Finding::good("kernel", format!("{release}, PREEMPT_RT"));
    }
    Finding::poor(
        "kernel",
        format!("{release}, not PREEMPT_RT: wake-ups may be late by milliseconds under load"),
        "install one: `sudo apt install linux-image-rt-amd64` (Debian), `sudo pro enable \
         realtime-kernel` (Ubuntu); `nullsweep latency --load` measures what this one does",
    )
}

/// The priority that the executor asks for unless told otherwise.
const PRIORITY: u64 = 80;

fn priority(limit: Option<u64>) -> Finding {
    match limit {
        Some(limit) if limit < PRIORITY => Finding::poor(
            "SCHED_FIFO",
            format!("priorities up to {limit} (ulimit -r), the executor asks for {PRIORITY}"),
            "echo \"$USER - rtprio 90\" | sudo tee -a /etc/security/limits.d/nullsweep.conf, then log \
             in anew",
        ),
        Some(limit) => Finding::good("SCHED_FIFO", format!("priorities up to {limit}")),
        None => Finding::good("SCHED_FIFO", "any priority"),
    }
}

/// What the executor locks at least. \[bytes\]
const LOCKED: u64 = 512 << 20;

fn memory(limit: Option<u64>) -> Finding {
    match limit {
        Some(limit) if limit < LOCKED => Finding::poor(
            "locked memory",
            format!("up to {} MiB (ulimit -l)", limit >> 20),
            "echo \"$USER - memlock unlimited\" | sudo tee -a /etc/security/limits.d/nullsweep.conf, \
             then log in anew",
        ),
        Some(limit) => Finding::good("locked memory", format!("up to {} MiB", limit >> 20)),
        None => Finding::good("locked memory", "as much as there is"),
    }
}

/// The governor of each CPU that has one.
fn governors(cpus: &Path) -> Vec<String> {
    let entries = fs::read_dir(cpus).into_iter().flatten().flatten();
    let governor =
        |cpu: fs::DirEntry| fs::read_to_string(cpu.path().join("cpufreq/scaling_governor")).ok();
    let mut all: Vec<String> =
        entries.filter_map(governor).map(|text| text.trim().to_owned()).collect();
    all.sort();
    all.dedup();
    all
}

fn governor(governors: &[String]) -> Finding {
    match governors {
        [] => Finding::good("CPU clock", "no governor to be seen"),
        [one] if one == "performance" => Finding::good("CPU clock", "governor performance"),
        others => Finding::poor(
            "CPU clock",
            format!("governor {}: the clock falls while the loop sleeps", others.join(", ")),
            "sudo cpupower frequency-set -g performance",
        ),
    }
}

/// What plans and recordings of streams take, with room. \[bytes\]
const SHARED: u64 = 256 << 20;

fn shared_memory(folder: &Path) -> Finding {
    let Ok(there) = rustix::fs::statvfs(folder) else {
        return Finding::poor(
            "shared memory",
            format!("no {}", folder.display()),
            "mount it: sudo mount -t tmpfs -o size=1G tmpfs /dev/shm; a container wants --shm-size 1g",
        );
    };
    let free = there.f_bavail * there.f_frsize;
    let found = format!("{} MiB free in {}", free >> 20, folder.display());
    if free < SHARED {
        let mend = "sudo mount -o remount,size=1G /dev/shm; a container wants --shm-size 1g";
        return Finding::poor("shared memory", found, mend);
    }
    Finding::good("shared memory", found)
}

/// How long a process may take to fill a file that it has made.
const STARTING: Duration = Duration::from_secs(10);

/// Whether a file was left empty.
fn is_left(file: &fs::Metadata) -> bool {
    let age = file.modified().ok().and_then(|at| at.elapsed().ok()).unwrap_or_default();
    file.is_file() && file.len() == 0 && age >= STARTING
}

/// Files of iceoryx2's that are empty: a process that died while it started leaves them, and others wait
/// for them.
fn leftovers(folder: &Path) -> Finding {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_ours = |name: &str| ["iox2_", "nsw_"].iter().any(|prefix| name.starts_with(prefix));
    let ours = entries.filter(|e| is_ours(&e.file_name().to_string_lossy()));
    let (mut all, mut empty) = (0, Vec::new());
    for entry in ours {
        all += 1;
        if entry.metadata().is_ok_and(|m| is_left(&m)) {
            empty.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    if empty.is_empty() {
        return Finding::good(
            "iceoryx2",
            format!("{all} files in {}, none empty", folder.display()),
        );
    }
    empty.sort();
    let (count, first) = (empty.len(), &empty[0]);
    Finding::poor(
        "iceoryx2",
        format!("{count} of {all} files are empty, a process died while it started: {first}"),
        format!(
            "when no program runs: find {} -maxdepth 1 '(' -name 'iox2_*' -o -name 'nsw_*' ')' -empty \
             -delete",
            folder.display()
        ),
    )
}

/// The version of each program beside this one.
fn versions() -> Finding {
    let own = env!("CARGO_PKG_VERSION");
    let programs = [PLANNER, EXECUTOR].into_iter().chain(whole().map(|(name, _)| name));
    let mut amiss = Vec::new();
    for program in programs {
        let told = Command::new(beside(program)).arg("--version").stdin(Stdio::null()).output();
        match told {
            Ok(told) => {
                let text = String::from_utf8_lossy(&told.stdout).trim().to_owned();
                if text.split_whitespace().last() != Some(own) {
                    amiss.push(format!("{program} is {text}"));
                }
            }
            Err(_) => amiss.push(format!("{program} is missing")),
        }
    }
    if amiss.is_empty() {
        return Finding::good("programs", format!("all of version {own}"));
    }
    Finding::poor(
        "programs",
        format!("this is {own}, but {}", amiss.join(", ")),
        "for p in planner/cli executor tests planner/front; do cargo install --path $p; done",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_poor(finding: &Finding) -> bool {
        finding.mend.is_some()
    }

    #[test]
    fn what_is_lacking_comes_with_what_mends_it() {
        let plain = "Linux version 6.12.1-generic (gcc) #1 SMP PREEMPT_DYNAMIC";
        assert!(is_poor(&kernel(plain, false)));
        assert!(!is_poor(&kernel(plain, true)));
        assert!(!is_poor(&kernel("Linux version 6.12.1-rt (gcc) #1 SMP PREEMPT_RT", false)));
        assert!(is_poor(&priority(Some(0))) && !is_poor(&priority(Some(90))));
        assert!(!is_poor(&priority(None)));
        assert!(is_poor(&memory(Some(8 << 20))) && !is_poor(&memory(None)));
        let named = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert!(is_poor(&governor(&named(&["performance", "powersave"]))));
        assert!(!is_poor(&governor(&named(&["performance"]))) && !is_poor(&governor(&[])));
        let text = told(&[priority(Some(0)), kernel(plain, true)]);
        assert!(text.starts_with("poor  SCHED_FIFO") && text.contains("rtprio 90"), "{text}");
        assert!(text.contains("\ngood  kernel"), "{text}");
    }

    #[test]
    fn empty_files_of_iceoryx2_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(is_poor(&shared_memory(&folder.path().join("none"))));
        let file = |name: &str, text: &str| {
            fs::write(folder.path().join(name), text).expect("written");
        };
        file("iox2_a", "sound");
        file("other", "");
        assert!(!is_poor(&leftovers(folder.path())));
        file("nsw_b", "");
        assert!(!is_poor(&leftovers(folder.path())), "it may be about to be filled");
        let old = std::time::SystemTime::now() - 2 * STARTING;
        let made = fs::File::options().append(true).open(folder.path().join("nsw_b"));
        made.expect("a file").set_modified(old).expect("a time");
        let found = leftovers(folder.path());
        assert!(is_poor(&found) && found.found.contains("nsw_b"), "{found:?}");
    }
}
