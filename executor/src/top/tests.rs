//! Pictures of a screen, and what the keys ask for.

use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use nullsweep_ipc_types::{
    CommandKind, EventKind, Fault, Mode, PlanEvent, PlanId, Reason, Telemetry,
};
use nullsweep_robot::{ArmSpec, Robot, Side};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::style::Color;

use super::board::Board;
use super::keys::{Deed, deed, faster};
use super::screen::{bar, draw};

fn board() -> Board {
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
    Board::new("pr2", &arm)
}

fn executing() -> Telemetry {
    let mut t = Telemetry {
        plan: PlanId { epoch: 0xabc, number: 2 },
        plan_time_ns: 1_250_000_000,
        knot: 17,
        speed_scale: 0.5,
        joint_count: 7,
        cycle: 5000,
        mode: Mode::Executing.wire(),
        ..Telemetry::zeroed()
    };
    (t.commanded[1], t.measured[1]) = (0.3, 0.4);
    (t.lateness[9], t.compute[4]) = (1000, 1000);
    t
}

fn picture(board: &Board, now: Instant, size: (u16, u16)) -> (String, Terminal<TestBackend>) {
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    terminal.draw(|frame| draw(frame, board, now)).unwrap();
    let text = terminal.backend().to_string();
    (text, terminal)
}

#[test]
fn a_running_plan_is_shown_with_its_joints() {
    let (mut board, now) = (board(), Instant::now());
    let plan = executing().plan;
    let kind = EventKind::Accepted.wire();
    board.event(&PlanEvent { plan, kind, bound: 5.0, ..PlanEvent::zeroed() });
    board.hear(executing(), now);
    let (text, terminal) = picture(&board, now, (110, 40));
    for part in [
        "executor of robot pr2",
        "executing",
        "plan abc/2  knot 17  1.25 s of 5.00 s (25 %, 7.5 s left)  speed 50 %  cycle 5000, 0 missed",
        "r_shoulder_lift_joint",
        "0.3000 rad",
        "+0.1000",
        "wake-up lateness: p50 <",
        "p pause",
        "an executor is there",
    ] {
        assert!(text.contains(part), "no {part}:\n{text}");
    }
    assert!(!text.contains("VERIFIED"), "{text}");
    // The one joint that is far off is red, the others are not.
    let cells = terminal.backend().buffer().content();
    let red: String = cells.iter().filter(|c| c.fg == Color::Red).map(|c| c.symbol()).collect();
    assert_eq!(red.trim(), "+0.1000");
}

#[test]
fn a_plan_that_is_not_verified_is_told() {
    let (mut board, now) = (board(), Instant::now());
    board.hear(Telemetry { unverified: 1, ..executing() }, now);
    let (text, terminal) = picture(&board, now, (110, 40));
    assert!(text.contains("executing  the plan is NOT VERIFIED"), "{text}");
    let cells = terminal.backend().buffer().content();
    let red: String = cells.iter().filter(|c| c.fg == Color::Red).map(|c| c.symbol()).collect();
    assert!(red.contains("NOT VERIFIED"), "{red}");
}

#[test]
fn an_executor_that_goes_and_comes_is_told() {
    let (mut board, now) = (board(), Instant::now());
    let (text, _) = picture(&board, now, (110, 40));
    assert!(text.contains("waiting for an executor: no telemetry comes"), "{text}");
    board.hear(executing(), now);
    let later = now + Duration::from_secs(2);
    board.look(later);
    let (text, _) = picture(&board, later, (110, 40));
    assert!(text.contains("waiting for an executor") && !text.contains("knot 17"), "{text}");
    board.trouble = Some("another user's".into());
    let (text, _) = picture(&board, later, (110, 40));
    assert!(text.contains("waiting for an executor: another user's"), "{text}");
    let fault = Telemetry { mode: Mode::Fault.wire(), fault: Fault::Halted.wire(), ..executing() };
    board.hear(fault, later);
    board.hear(Telemetry { missed_cycles: 3, ..fault }, later);
    board.hear(Telemetry { missed_cycles: 5, ..fault }, later);
    let log: Vec<&str> = board.log().collect();
    let told = [
        "an executor is there",
        "executing",
        "the executor is silent",
        "an executor is there",
        "fault: the hardware endpoint halted",
        "deadlines missed: 5",
    ];
    assert_eq!(log, told);
}

#[test]
fn what_became_of_a_plan_is_told_with_its_joint() {
    let mut board = board();
    let event = PlanEvent {
        plan: PlanId { epoch: 1, number: 4 },
        kind: EventKind::Rejected.wire(),
        reason: Reason::Velocity.wire(),
        knot: 12,
        joint: 3,
        value: 3.5,
        bound: 3.3,
        ..PlanEvent::zeroed()
    };
    board.event(&event);
    for _ in 0..1000 {
        board.event(&PlanEvent { joint: u32::MAX, knot: u32::MAX, reason: 0, kind: 99, ..event });
    }
    let log: Vec<&str> = board.log().collect();
    assert!(log.len() == 200 && log[0] == "plan 1/4: event 99, reason 0", "{log:?}");
    let mut board = self::board();
    board.event(&event);
    let told = format!(
        "plan 1/4 rejected: {}, knot 12, joint r_elbow_flex_joint: 3.5000 rad/s against the limit \
         3.3000 rad/s; ",
        Reason::Velocity
    );
    let said: Vec<&str> = board.log().collect();
    assert!(said.len() == 1 && said[0].starts_with(&told), "{said:?}");
    // The index of a held joint is none of the arm's.
    board.event(&PlanEvent { reason: Reason::HeldJoint.wire(), joint: 1, ..event });
    let held = board.log().last().unwrap();
    assert!(held.contains("measured at") && !held.contains("r_shoulder"), "{held}");
}

/// Whatever comes over the wire and however small the window, there is a picture.
#[test]
fn any_telemetry_has_a_picture_of_any_size() {
    let now = Instant::now();
    for (joints, value) in [(0, 0.0), (7, f64::NAN), (7, f64::INFINITY), (u32::MAX, -1e300)] {
        let mut t = Telemetry { joint_count: joints, mode: 99, fault: 99, ..executing() };
        t.commanded = [value; 16];
        t.measured = [-value; 16];
        t.speed_scale = value;
        t.lateness = [u32::MAX; 32];
        let mut board = board();
        board.hear(t, now);
        for size in [(1, 1), (20, 5), (80, 24), (300, 100)] {
            picture(&board, now, size);
        }
    }
}

#[test]
fn a_bar_shows_where_a_joint_is() {
    assert!(bar(-1.0, (-1.0, 1.0)).starts_with('█') && bar(1.0, (-1.0, 1.0)).ends_with('█'));
    assert_eq!(bar(0.0, (-1.0, 1.0)).chars().position(|c| c == '█'), Some(10));
    assert!(bar(2.0, (-1.0, 1.0)).starts_with('>') && bar(-2.0, (-1.0, 1.0)).starts_with('<'));
    let endless = (f64::NEG_INFINITY, f64::INFINITY);
    assert!(bar(0.0, endless).trim().is_empty() && bar(f64::NAN, (-1.0, 1.0)).trim().is_empty());
}

#[test]
fn keys_ask_for_commands() {
    let press = |c| deed(KeyEvent::new(KeyCode::Char(c), KeyModifiers::NONE));
    for (key, kind) in [
        ('p', CommandKind::Pause),
        ('r', CommandKind::Resume),
        ('s', CommandKind::Stop),
        (' ', CommandKind::Stop),
        ('d', CommandKind::StopAndDisable),
        ('x', CommandKind::Reset),
    ] {
        assert_eq!(press(key), Some(Deed::Command(kind)));
    }
    assert_eq!((press('q'), press('z')), (Some(Deed::Quit), None));
    let control = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert_eq!(deed(control), Some(Deed::Quit));
    // What is meant for the terminal moves no arm; a stop is a stop.
    for modifiers in [KeyModifiers::CONTROL, KeyModifiers::ALT] {
        for key in ['p', 'r', 'd', 'x', '+', '-', 'q'] {
            assert_eq!(deed(KeyEvent::new(KeyCode::Char(key), modifiers)), None, "{key}");
        }
        let stop = deed(KeyEvent::new(KeyCode::Char('s'), modifiers));
        assert_eq!(stop, Some(Deed::Command(CommandKind::Stop)));
    }
    // Steps of a tenth from what was asked for last, within 0 and 1.
    assert_eq!((press('+'), press('-')), (Some(Deed::Speed(0.1)), Some(Deed::Speed(-0.1))));
    assert_eq!((faster(1.0, 0.1), faster(0.05, -0.1), faster(f64::NAN, 0.1)), (1.0, 0.0, 0.0));
    assert!((faster(0.5, -0.1) - 0.4).abs() < 1e-12);
}
