//! `planner plan --stops`, its jobs, `planner join`, and what reads a program.

use std::path::Path;
use std::process::{Command, Output};

fn planner(folder: &Path, args: &str) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planner"));
    let Output { status, stderr, stdout } =
        command.args(args.split(' ')).current_dir(folder).output().expect("it starts");
    let said = [stdout, stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    (status.code(), said.concat())
}

/// One arm, one stop, a lift that is given: little to look at.
const SEAT: &str = "plan --demo chair-seat --torso 0.2 --ik-samples 12 --refinements 0 --stops 1 \
                    --arms right";

fn files(folder: &Path, ending: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(ending))
        .collect();
    names.sort();
    names
}

#[test]
fn jobs_come_to_the_program_of_one_process_to_the_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let (code, said) = planner(here, &format!("{SEAT} --out one.json --report one.html"));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("in reach of any stop"), "{said}");

    let (code, said) = planner(here, &format!("{SEAT} --jobs jobs"));
    assert_eq!(code, Some(0), "{said}");
    let again = planner(here, &format!("{SEAT} --jobs jobs"));
    assert!(again.0 == Some(1) && again.1.contains("has jobs already"), "{}", again.1);
    let mut rounds = 0;
    loop {
        let (code, said) = planner(here, "join jobs --out many.json");
        if code == Some(0) {
            break;
        }
        assert_eq!(code, Some(5), "{said}");
        rounds += 1;
        assert!(rounds < 9, "{said}");
        let jobs = here.join("jobs");
        for job in files(&jobs, ".job.json") {
            if !jobs.join(job.replace(".job.", ".done.")).exists() {
                let (code, said) = planner(here, &format!("plan --job jobs/{job}"));
                assert_eq!(code, Some(0), "{said}");
            }
        }
    }
    let read = |name: &str| std::fs::read(here.join(name)).expect("a program");
    assert!(read("one.json") == read("many.json"), "jobs came to another program");

    // What reads programs.
    let (code, said) = planner(here, "verify one.json --demo chair-seat");
    assert!(code == Some(0) && said.contains("swept of all points"), "{said}");
    let (code, said) = planner(here, "inspect one.json --plans plans");
    assert!(code == Some(0) && said.contains("verified: yes"), "{said}");
    let plans = files(&here.join("plans"), ".json");
    assert!(plans.contains(&"stop-1-1.json".to_owned()), "{plans:?}");
    let (code, said) = planner(here, "inspect plans/stop-1-1.json");
    assert!(code == Some(0) && said.contains("duration"), "{said}");
    let (code, said) = planner(here, "view one.json --no-open --out view.html");
    assert_eq!(code, Some(0), "{said}");
    let page = std::fs::read_to_string(here.join("view.html")).expect("a page");
    assert!(page.contains("Nullsweep program") && page.contains("stop 1"));
    // A program is no plan, and that is told.
    let (code, said) = planner(here, "export one.json --format csv");
    assert!(code == Some(1) && said.contains("--plans"), "{said}");
}

#[test]
fn what_cannot_go_together_is_wrong_usage() {
    let folder = tempfile::tempdir().expect("a folder");
    for wrong in [
        "plan --demo chair-seat --stops 0",
        "plan --demo chair-seat --stops auto --base 0,0,0",
        "plan --demo chair-seat --stops auto --start home",
        "plan --demo chair-seat --stops auto --arms left,left",
        "plan --demo chair-seat --arms left",
        "plan --demo chair-seat --jobs there",
        "plan --demo chair-seat --job there",
        "plan",
    ] {
        let (code, said) = planner(folder.path(), wrong);
        assert_eq!(code, Some(2), "{wrong}: {said}");
    }
    let (code, said) = planner(folder.path(), "plan --job none.job.json");
    assert!(code == Some(1) && said.contains("none.job.json"), "{said}");
}
