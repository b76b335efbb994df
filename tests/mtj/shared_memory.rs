//! Shared memory: who may see it, what stays of the dead, and what happens where there is none
//! left.

use std::{
    collections::BTreeSet,
    fs,
    os::unix::fs::{MetadataExt, PermissionsExt},
    path::Path,
};

use crate::session::{Running, Session, eventually, shared_memory, shared_memory_of};
use nix::sys::signal::Signal;

const PLANT: &str = "plant --json --scenario sampled/mtj --set duration=1h";

fn begin(session: &Session) -> [Running; 3] {
    let roles = [PLANT, "controller", "monitor"].map(|role| session.start(role));
    eventually("a line of the monitor", || roles[2].stdout().contains("|e|").then_some(()));
    roles
}

/// Whether nobody but the owner can have to do with it: by its mode, or by that of a directory
/// above.
fn is_private(path: &Path) -> bool {
    path.ancestors().take_while(|path| *path != Path::new("/dev/shm")).any(|path| {
        let Ok(found) = fs::symlink_metadata(path) else { return true };
        found.permissions().mode() & 0o077 == 0
    })
}

#[test]
fn shared_memory_is_for_one_user_only() {
    let session = Session::on("iceoryx2");
    let _roles = begin(&session);
    let found = shared_memory();
    assert!(found.len() > 30, "the loop is in shared memory: {found:?}");
    for path in found {
        assert!(is_private(Path::new(&path)), "{path}");
    }
}

#[test]
fn the_next_process_removes_what_crashed_processes_left() {
    let session = Session::on("iceoryx2");
    let mut roles = begin(&session);
    let processes: Vec<u32> = roles.iter().map(Running::id).collect();
    assert!(!shared_memory_of(&processes).is_empty());
    for role in &mut roles {
        role.signal(Signal::SIGKILL);
        role.wait();
    }
    // Of another session even.
    let other = Session::on("iceoryx2");
    let mut monitor = other.start("monitor");
    eventually("it lives", || (!shared_memory_of(&[monitor.id()]).is_empty()).then_some(()));
    eventually("the dead are gone", || shared_memory_of(&processes).is_empty().then_some(()));
    monitor.signal(Signal::SIGTERM);
    assert!(monitor.wait().success());
    assert_eq!(shared_memory_of(&[monitor.id()]), BTreeSet::new());
}

#[test]
fn a_role_killed_in_start_up_does_not_block_others() {
    let session = Session::on("iceoryx2");
    let mut roles = begin(&session);
    for (index, role) in [PLANT, "controller", "monitor"].iter().enumerate() {
        roles[index].signal(Signal::SIGKILL);
        roles[index].wait();
        for microseconds in (0..20_000).step_by(1000) {
            let mut short = session.start(role);
            std::thread::sleep(std::time::Duration::from_micros(microseconds));
            short.signal(Signal::SIGKILL);
            short.wait();
        }
        roles[index] = session.start(role);
        // A new line of a monitor that hears the loop.
        let heard = session.start("monitor");
        eventually("the loop goes on", || heard.stdout().contains("|e|").then_some(()));
    }
}

#[test]
fn a_second_plant_is_refused_in_one_sentence() {
    let session = Session::on("iceoryx2");
    let _roles = begin(&session);
    let mut second = session.start(PLANT);
    assert_eq!(second.wait().code(), Some(2), "{}", second.stderr());
    let said = second.stderr();
    assert!(said.contains("--session") && said.trim_end().lines().count() == 1, "{said}");
}

/// Whether a test may have a small /dev/shm of its own.
fn may_mount() -> bool {
    let is_root = fs::metadata("/proc/self").unwrap().uid() == 0;
    if !is_root {
        eprintln!("only root may mount a /dev/shm: nothing is tested here");
    }
    is_root
}

/// What a shell is told to do something first, and then be a role.
fn shell(session: &Session, first: &str, role: &str) -> String {
    format!(
        "{first} && exec {} {role} --session {} --bus iceoryx2",
        crate::session::MTJ,
        session.name
    )
}

#[test]
fn a_role_says_that_shared_memory_is_full() {
    if !may_mount() {
        return;
    }
    let session = Session::on("iceoryx2");
    for size in ["64k", "1m", "8m", "16m"] {
        for role in [PLANT, "controller", "monitor"] {
            let mount = format!("mount -t tmpfs -o size={size},mode=1777 tmpfs /dev/shm");
            let line = shell(&session, &mount, role);
            let mut role = session.start_program("unshare", &["--mount", "sh", "-c", &line]);
            assert_eq!(role.wait().code(), Some(1), "{size}: {}", role.stderr());
            let said = role.stderr();
            assert!(said.contains("/dev/shm") && said.trim_end().lines().count() == 1, "{said}");
        }
    }
}

#[test]
fn a_loop_goes_on_where_shared_memory_becomes_full() {
    if !may_mount() {
        return;
    }
    let session = Session::on("iceoryx2");
    let role =
        |role| format!("{} {role} --session {} --bus iceoryx2", crate::session::MTJ, session.name);
    let script = format!(
        "mount -t tmpfs -o size=64m,mode=1777 tmpfs /dev/shm
         {} & controller=$!
         {} > /dev/null & monitor=$!
         {} & plant=$!
         sleep 2
         dd if=/dev/zero of=/dev/shm/full bs=64k 2> /dev/null
         kill -STOP $monitor
         wait $plant; status=$?
         kill -KILL $controller $monitor
         exit $status",
        role("controller"),
        role("monitor"),
        role("plant --json --scenario sampled/mtj --set duration=8s")
    );
    let mut shell = session.start_program("unshare", &["--mount", "sh", "-c", &script]);
    assert!(shell.wait().success(), "{}", shell.stderr());
    let report: serde_json::Value = serde_json::from_str(&shell.stdout()).unwrap();
    assert_eq!((&report["samples"], &report["diverged"]), (&800.into(), &false.into()));
    let applied = report["commands"]["applied"].as_u64().unwrap();
    assert!(applied > 300, "it went on after the first two seconds: {report}");
}

#[test]
fn a_role_says_that_there_are_no_descriptors_left() {
    let session = Session::on("iceoryx2");
    for count in [16, 40, 100] {
        for role in [PLANT, "controller", "monitor"] {
            let line = shell(&session, &format!("ulimit -n {count}"), role);
            let mut role = session.start_program("sh", &["-c", &line]);
            assert_eq!(role.wait().code(), Some(1), "{count}: {}", role.stderr());
            let said = role.stderr();
            assert!(said.contains("ulimit") && said.trim_end().lines().count() == 1, "{said}");
        }
    }
}
