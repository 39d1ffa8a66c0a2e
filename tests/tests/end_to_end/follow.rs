//! A given path: planned by `planner follow`, published and gone along as any plan.

use std::ffi::OsString;

use nullsweep_tests::stage::Part;
use nullsweep_tests::system::System;
use nullsweep_tests::witness::PATIENCE;

use crate::common::{stage, verdict};
use crate::rig;

#[test]
fn a_followed_path_is_published_and_gone_along() {
    let stage = stage();
    // Two rows in front of the PR2, the gripper's x axis ahead; its tip frame meets them.
    let row = |x: f64| {
        (0..5).map(move |i| format!("{x},{x},{},0.75,0,0,0,1\n", 0.05 * f64::from(i) - 0.4))
    };
    let rows: String = [0.6, 0.65].into_iter().flat_map(row).collect();
    let path = stage.file("path.csv");
    std::fs::write(&path, format!("segment,x,y,z,qx,qy,qz,qw\n{rows}")).expect("written");
    let plan = stage.file("path.json");
    let args: Vec<OsString> =
        ["follow", path.to_str().expect("UTF-8"), "--profile", "acceleration", "--out"]
            .into_iter()
            .map(OsString::from)
            .chain([plan.clone().into()])
            .collect();
    let mut planner = stage.start(Part::Planner, "follow", args).expect("the planner starts");
    let status = planner.wait(PATIENCE).expect("known").expect("it ends");
    assert!(status.success(), "{}{}", planner.stdout(), planner.stderr());

    let plan = plan.to_str().expect("UTF-8");
    let System { endpoint: mut mock, executor: _executor, .. } =
        rig::start(&stage, &["--plan", plan]);
    let mut args: Vec<OsString> = vec!["publish".into(), plan.into(), "--wait".into()];
    args.extend(stage.place());
    let mut publish = stage.start(Part::Planner, "publish", args).expect("the planner starts");
    let status = publish.wait(PATIENCE).expect("known").expect("it ends");
    let said = format!("{}{}", publish.stdout(), publish.stderr());
    assert!(status.success() && said.contains("finished"), "{said}");
    let found = verdict(&stage, &mut mock);
    assert_eq!(found["violations"], 0, "{found:#}");
}
