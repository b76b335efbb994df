//! Who may move the arm: the loop over TLS and QUIC, and everybody who is not in it.

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use crate::intruder::{Intruder, Papers, Say, connect};
use crate::session::{Running, Session, eventually, free_port};
use rcgen::{CertificateParams, DistinguishedName, DnType, Issuer, KeyPair};
use time::{Duration, OffsetDateTime};
use zenoh::{Config, Wait};

/// What is run: 2000 samples, each waiting for its answer.
const RUN: &str = "--set timing.clock=lockstep --set duration=20s";
/// All that an intruder can think of.
const ALL: [Say; 6] =
    [Say::Torque, Say::Request, Say::State, Say::Presence, Say::Scenario, Say::Everything];

/// A session with certificates for its roles, and an address for its plant.
struct Secured {
    session: Session,
    endpoint: String,
}

impl Secured {
    fn over(protocol: &str) -> Self {
        let secured = Self {
            session: Session::on("local"),
            endpoint: format!("{protocol}/127.0.0.1:{}", free_port()),
        };
        secured.certify("pki", "");
        secured
    }

    fn certify(&self, directory: &str, more: &str) {
        assert_ends_well(self.start(&format!("certs --out {directory}{more}")));
    }

    fn path(&self, file: &str) -> PathBuf {
        self.session.directory.join(file)
    }

    /// Starts `mtj` with these arguments, split at blanks.
    fn start(&self, arguments: &str) -> Running {
        self.session.start_exactly(&arguments.split(' ').collect::<Vec<_>>())
    }

    /// Starts a role on the session's bus.
    fn role(&self, arguments: &str) -> Running {
        let at = if arguments.starts_with("plant") { "--listen" } else { "--connect" };
        let Self { session, endpoint, .. } = self;
        self.start(&format!("{arguments} {at} {endpoint} --certs pki --session {}", session.name))
    }

    fn plant(&self) -> Running {
        self.role(&format!("plant {RUN} --json --trace trace.csv"))
    }

    /// The trace of a run that nobody disturbs.
    fn undisturbed(&self) -> String {
        assert_ends_well(self.start(&format!("run {RUN} --trace undisturbed.csv")));
        fs::read_to_string(self.path("undisturbed.csv")).unwrap()
    }

    fn trace(&self) -> String {
        fs::read_to_string(self.path("trace.csv")).unwrap()
    }

    /// A session with the plant, or whatever is in its place, under a certificate of our authority.
    fn connect(&self, name: &str) -> zenoh::Session {
        eventually("a listener", || self.try_connect("pki", name).ok())
    }

    /// The same under a certificate from another directory.
    fn try_connect(&self, directory: &str, name: &str) -> zenoh::Result<zenoh::Session> {
        let file = |ending: &str| self.path(&format!("{directory}/{name}.{ending}"));
        let own = (&*file("pem"), &*file("key"));
        connect(&self.endpoint, &Papers { authority: &self.path("pki/ca.pem"), own: Some(own) })
    }

    /// Runs the loop while `intruder` does what it can; fails unless the arm moves as if it were
    /// not there.
    fn assert_unmoved_by(&self, intruder: Intruder, mut plant: Running) {
        let undisturbed = self.undisturbed();
        assert!(!plant.has_ended(), "{}", plant.stderr());
        let monitor = self.role("monitor");
        let _controller = self.role("controller");
        let status = plant.wait();
        let heard = intruder.end();
        assert!(status.success(), "{}", plant.stderr());
        assert!(self.trace() == undisturbed, "the trajectory is another one; {heard:?}");
        let report: serde_json::Value = serde_json::from_str(&plant.stdout()).unwrap();
        // Over a slow way the controller answers a first state twice that was repeated; the
        // intruder answers thousands.
        let rejected = report["commands"]["rejected"].as_u64().unwrap();
        assert!(rejected < 20, "its torques have come as far as the gate: {rejected}");
        assert!(heard.states > 1000 && heard.statuses > 0, "it may read: {heard:?}");
        let watched =
            eventually("a line", || Some(monitor.stdout()).filter(|said| !said.is_empty()));
        assert!(!watched.contains("changed: "), "{watched}");
    }
}

fn assert_ends_well(mut run: Running) {
    let status = run.wait();
    assert!(status.success(), "{status}: {}{}", run.stdout(), run.stderr());
}

/// Fails unless `mtj` refuses these arguments in one sentence with all the words.
fn assert_refused(secured: &Secured, arguments: &str, words: &[&str]) {
    let mut run = secured.start(arguments);
    let (status, said) = (run.wait(), run.stderr());
    assert_eq!(status.code(), Some(2), "{arguments}: {said}");
    assert_eq!(said.lines().count(), 1, "{arguments}: {said}");
    for word in words {
        assert!(said.contains(word), "{arguments}: '{word}' is not in: {said}");
    }
}

#[test]
fn the_loop_is_the_same_over_mutual_tls_and_quic() {
    for protocol in ["tls", "quic"] {
        let secured = Secured::over(protocol);
        let mut plant = secured.plant();
        let _roles = [secured.role("controller"), secured.role("monitor")];
        assert!(plant.wait().success(), "{protocol}: {}", plant.stderr());
        assert!(secured.trace() == secured.undisturbed(), "over {protocol}");
    }
}

#[test]
fn a_launch_hands_certificates_on() {
    let secured = Secured::over("tls");
    assert_ends_well(secured.start(&format!("run {RUN} --certs pki --trace trace.csv")));
    assert!(secured.trace() == secured.undisturbed());
    fs::remove_file(secured.path("pki/controller.key")).unwrap();
    assert_refused(
        &secured,
        &format!("run {RUN} --certs pki"),
        &["pki/controller.key", "mtj certs"],
    );
}

#[test]
fn a_monitor_that_commands_moves_nothing() {
    for protocol in ["tls", "quic"] {
        let secured = Secured::over(protocol);
        let plant = secured.plant();
        let intruder = Intruder::begin(secured.connect("monitor"), &secured.session.name, &ALL);
        secured.assert_unmoved_by(intruder, plant);
    }
}

#[test]
fn a_controller_and_an_operator_do_nothing_but_their_own() {
    let others = |own: Say| ALL.into_iter().filter(|say| *say != own).collect::<Vec<_>>();
    let secured = Secured::over("tls");
    let plant = secured.plant();
    // A controller may also say that it is one.
    let mut says = others(Say::Torque);
    says.retain(|say| *say != Say::Presence);
    let intruder = Intruder::begin(secured.connect("controller"), &secured.session.name, &says);
    secured.assert_unmoved_by(intruder, plant);
    let plant = secured.plant();
    let says = others(Say::Request);
    let intruder = Intruder::begin(secured.connect("operator"), &secured.session.name, &says);
    secured.assert_unmoved_by(intruder, plant);
}

#[test]
fn the_same_words_move_the_arm_if_the_certificate_is_right() {
    let secured = Secured::over("tls");
    let mut plant = secured.plant();
    let intruder =
        Intruder::begin(secured.connect("controller"), &secured.session.name, &[Say::Torque]);
    assert!(plant.wait().success(), "without any other controller: {}", plant.stderr());
    assert!(intruder.end().newest > 0);
    let undisturbed = secured.undisturbed();
    assert!(secured.trace() != undisturbed);
    let mut plant = secured.plant();
    let intruder =
        Intruder::begin(secured.connect("operator"), &secured.session.name, &[Say::Request]);
    let _controller = secured.role("controller");
    assert!(plant.wait().success(), "{}", plant.stderr());
    intruder.end();
    assert!(secured.trace() != undisturbed);
}

#[test]
fn a_process_without_a_valid_certificate_is_not_connected() {
    for protocol in ["tls", "quic"] {
        let secured = Secured::over(protocol);
        secured.certify("foreign", "");
        issue(&secured.path("pki"), "expired", -Duration::days(1));
        issue(&secured.path("pki"), "valid", Duration::days(1));
        let plant = secured.plant();
        let witness = Intruder::begin(secured.connect("monitor"), &secured.session.name, &[]);
        let attempt = |what: &str| match what {
            "none" => {
                let papers = Papers { authority: &secured.path("pki/ca.pem"), own: None };
                connect(&secured.endpoint, &papers)
            }
            "foreign" => secured.try_connect("foreign", "controller"),
            "plain" => {
                let papers = Papers { authority: &secured.path("pki/ca.pem"), own: None };
                connect(&secured.endpoint.replace(protocol, "tcp"), &papers)
            }
            name => secured.try_connect("pki", name),
        };
        for what in ["none", "expired", "foreign", "plain"] {
            assert!(attempt(what).is_err(), "{protocol}, {what}");
        }
        assert!(attempt("valid").is_ok(), "the way is open to others: {protocol}");
        secured.assert_unmoved_by(witness, plant);
    }
}

/// Has the authority in a directory certify a controller from two days ago until some time from
/// now.
fn issue(directory: &Path, file: &str, until: Duration) {
    let named = |name: &str| {
        let mut params = CertificateParams::default();
        params.distinguished_name = DistinguishedName::new();
        params.distinguished_name.push(DnType::CommonName, name);
        params
    };
    let key = fs::read_to_string(directory.join("ca.key")).unwrap();
    let authority = Issuer::new(named("mtj authority"), KeyPair::from_pem(&key).unwrap());
    let mut params = named("controller");
    params.not_before = OffsetDateTime::now_utc() - Duration::days(2);
    params.not_after = OffsetDateTime::now_utc() + until;
    let key = KeyPair::generate().unwrap();
    let certificate = params.signed_by(&key, &authority).unwrap();
    fs::write(directory.join(format!("{file}.pem")), certificate.pem()).unwrap();
    fs::write(directory.join(format!("{file}.key")), key.serialize_pem()).unwrap();
}

#[test]
fn a_router_keeps_the_same_rules() {
    let mut secured = Secured::over("tls");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/router.json5");
    let text = fs::read_to_string(file).unwrap();
    // As if it were started in the directory of its certificates.
    let pki = secured.path("pki").display().to_string();
    let text = ["ca.pem", "router.pem", "router.key"].iter().fold(text, |text, name| {
        text.replace(&format!("\"{name}\""), &format!("\"{pki}/{name}\""))
    });
    let mut config = Config::from_json5(&text).unwrap();
    config.insert_json5("listen/endpoints", &format!("[{:?}]", secured.endpoint)).unwrap();
    let router = zenoh::open(config).wait().unwrap();
    let plant = |secured: &Secured| {
        let listen = format!("tls/127.0.0.1:{}", free_port());
        let Secured { session, endpoint } = secured;
        secured.start(&format!(
            "plant {RUN} --json --trace trace.csv --listen {listen} --connect {endpoint} --certs pki --session {}",
            session.name
        ))
    };
    let running = plant(&secured);
    let intruder = Intruder::begin(secured.connect("monitor"), &secured.session.name, &ALL);
    secured.assert_unmoved_by(intruder, running);
    // A plant does not take a router's word for everything either: its own session is the only one
    // there.
    secured.session.name += "-another";
    let running = plant(&secured);
    let intruder = Intruder::begin(secured.connect("operator"), &secured.session.name, &ALL[2..]);
    secured.assert_unmoved_by(intruder, running);
    router.close().wait().unwrap();
}

#[test]
fn only_an_operator_changes_a_loop() {
    let secured = Secured::over("tls");
    let _plant = secured.role("plant --set duration=1h --set timing.clock=realtime");
    let _controller = secured.role("controller");
    assert_ends_well(secured.role("set law.kp=31"));
    let mut refused = secured.role("set law.kp=32 --identity monitor");
    assert_eq!(refused.wait().code(), Some(1));
    assert!(refused.stderr().contains("--identity operator"), "{}", refused.stderr());
    for (identity, status, word) in
        [("monitor", 504, "--identity operator"), ("operator", 200, "law.kp=33")]
    {
        let monitor = secured.role(&format!("monitor --web 127.0.0.1:0 --identity {identity}"));
        let (address, token) = eventually("an address", || {
            let said = monitor.stderr();
            let (address, rest) = said.split_once("dashboard at ")?.1.split_once("/#token=")?;
            Some((address.to_owned(), rest.split_once('\n')?.0.to_owned()))
        });
        eventually("a plant", || monitor.stdout().contains("mtj").then_some(()));
        let agent: ureq::Agent =
            ureq::Agent::config_builder().http_status_as_error(false).build().into();
        let mut answer = agent
            .post(format!("{address}/knob"))
            .header("Content-Type", "application/json")
            .header("Authorization", format!("Bearer {token}"))
            .send(r#"{"set":["law.kp=33"]}"#)
            .unwrap();
        let said = answer.body_mut().read_to_string().unwrap();
        assert_eq!(answer.status().as_u16(), status, "{said}");
        assert!(said.contains(word), "{said}");
    }
}

#[test]
fn no_role_listens_beyond_this_machine_unless_told_to() {
    let secured = Secured::over("tls");
    let open = format!("tcp/0.0.0.0:{}", free_port());
    for command in ["plant", "run", "up"] {
        assert_refused(
            &secured,
            &format!("{command} --listen {open}"),
            &["bus.listen", &open, "could move the arm", "--certs", "--insecure"],
        );
    }
    fs::write(secured.path("plain.json5"), format!("{{ listen: {{ endpoints: [{open:?}] }} }}"))
        .unwrap();
    fs::write(secured.path("empty.json5"), "{ mode: \"peer\" }").unwrap();
    for (file, endpoint) in [("plain.json5", &*open), ("empty.json5", "tcp/[::]:0")] {
        for command in ["plant", "controller", "monitor"] {
            let arguments = format!("{command} --zenoh-config {file}");
            assert_refused(&secured, &arguments, &[file, endpoint, "--certs", "--insecure"]);
        }
    }
    // A process that says so is heard, and so is one that connects.
    let session = &secured.session.name;
    let mut plant = secured.start(&format!(
        "plant {RUN} --insecure --listen {open} --trace trace.csv --session {session}"
    ));
    let near = open.replace("0.0.0.0", "127.0.0.1");
    let _controller = secured.start(&format!("controller --connect {near} --session {session}"));
    assert!(plant.wait().success(), "{}", plant.stderr());
    assert!(secured.trace() == secured.undisturbed());
}

#[test]
fn a_zenoh_configuration_may_bring_mutual_tls_of_its_own() {
    let secured = Secured::over("tls");
    let endpoint = secured.endpoint.replace("127.0.0.1", "0.0.0.0");
    let text = |mutual: bool| {
        format!(
            "{{ mode: 'peer', listen: {{ endpoints: ['{endpoint}'] }}, transport: {{ link: {{ tls: {{
                root_ca_certificate: 'pki/ca.pem', listen_certificate: 'pki/plant.pem',
                listen_private_key: 'pki/plant.key', enable_mtls: {mutual} }} }} }},
                scouting: {{ multicast: {{ enabled: false }} }} }}"
        )
    };
    fs::write(secured.path("mutual.json5"), text(true)).unwrap();
    fs::write(secured.path("one-sided.json5"), text(false)).unwrap();
    assert_refused(
        &secured,
        "plant --zenoh-config one-sided.json5",
        &["one-sided.json5", &endpoint],
    );
    let mut plant = secured.start(&format!(
        "plant {RUN} --zenoh-config mutual.json5 --trace trace.csv --session {}",
        secured.session.name
    ));
    let _controller = secured.role("controller");
    assert!(plant.wait().success(), "{}", plant.stderr());
}

#[test]
fn certificates_that_are_of_no_use_are_refused_by_name() {
    let secured = Secured::over("tls");
    let endpoint = &secured.endpoint;
    let tls = format!("controller --connect {endpoint}");
    assert_refused(&secured, &tls, &["bus.connect", endpoint, "--certs", "mtj certs"]);
    for plain in ["tcp/127.0.0.1:7447", "udp/127.0.0.1:7447"] {
        let arguments = format!("plant --listen {plain} --certs pki");
        assert_refused(&secured, &arguments, &["bus.listen", plain, "tls/ or quic/"]);
    }
    let tls = |more: &str| format!("{tls} --certs {more}");
    assert_refused(&secured, &tls("nowhere"), &["nowhere/ca.pem", "No such file", "mtj certs"]);
    assert_refused(&secured, &tls("pki --identity cook"), &["pki/cook.pem", "No such file"]);
    assert_refused(&secured, &tls("pki --identity ../cook"), &["bus.identity", "../cook"]);
    issue(&secured.path("pki"), "expired", -Duration::days(1));
    assert_refused(&secured, &tls("pki --identity expired"), &["pki/expired.pem", "expired on 20"]);
    fs::copy(secured.path("pki/monitor.key"), secured.path("pki/controller.key")).unwrap();
    let words = ["pki/controller.key", "does not belong to", "pki/controller.pem"];
    assert_refused(&secured, &tls("pki"), &words);
    fs::write(secured.path("pki/ca.pem"), "torn").unwrap();
    assert_refused(&secured, &tls("pki"), &["pki/ca.pem", "PEM"]);
}

#[test]
fn an_authority_signs_again_and_is_never_replaced() {
    let secured = Secured::over("tls");
    let read = |name: &str| fs::read_to_string(secured.path(&format!("pki/{name}"))).unwrap();
    let (authority, plant) = (read("ca.pem"), read("plant.pem"));
    secured.certify("pki", " --host robot.example.org --host 192.0.2.7 --days 7");
    assert_eq!(authority, read("ca.pem"));
    assert_ne!(plant, read("plant.pem"));
    for entry in fs::read_dir(secured.path("pki")).unwrap().map(Result::unwrap) {
        let mode = entry.metadata().unwrap().permissions().mode() & 0o777;
        let is_key = entry.path().extension().is_some_and(|ending| ending == "key");
        assert_eq!(mode & 0o077 == 0, is_key, "{:?}: {mode:o}", entry.path());
    }
    assert_refused(&secured, "certs --out pki --host not/a/name", &["--host", "not/a/name"]);
    secured.certify("other", "");
    fs::copy(secured.path("other/ca.key"), secured.path("pki/ca.key")).unwrap();
    assert_refused(&secured, "certs --out pki", &["pki/ca.key", "pki/ca.pem"]);
    fs::remove_file(secured.path("pki/ca.key")).unwrap();
    assert_refused(&secured, "certs --out pki", &["ca.pem without ca.key"]);
    assert_eq!(authority, read("ca.pem"));
}
