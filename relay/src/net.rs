//! The network: zenoh's session, its configuration, and what is said over it.

use std::sync::mpsc;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use anyhow::{Context, bail};
use serde_json::Value;
use zenoh::Wait;
use zenoh::config::Config;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable, Reply};
use zenoh::session::Session;

use crate::args::NetArgs;

/// What is set where no file of zenoh's is given. Nobody is looked for: an end is told where the other
/// one is. Many bytes of a plan are zeros. A slow link is no broken one, and what waits in the system's
/// own buffers before a command is bounded.
const SETTINGS: &[(&str, &str)] = &[
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/enabled", "false"),
    ("connect/retry", "{ period_init_ms: 250, period_max_ms: 2000, period_increase_factor: 2 }"),
    ("transport/unicast/compression/enabled", "true"),
    ("transport/link/tx/queue/congestion_control/block/wait_before_close", "60000000"),
    ("transport/link/tx/batch_size", "16384"),
    ("transport/link/tcp", "{ so_sndbuf: 65536 }"),
    ("transport/link/tls/so_sndbuf", "65536"),
];

/// A session, and the beginning of all its keys.
#[derive(Clone)]
pub struct Net {
    session: Session,
    prefix: String,
    /// What may have to wait until the network takes it: answers and small questions, and plans.
    mouth: Mouth,
    freight: Mouth,
}

/// How a question is asked.
#[derive(Clone, Copy, Debug)]
pub struct Manner {
    /// How long an answer is waited for.
    pub within: Duration,
    pub priority: Priority,
    /// It is long: others are not to wait for it.
    pub is_freight: bool,
}

impl Manner {
    /// That of a few bytes.
    pub fn brief(within: Duration) -> Self {
        Self { within, priority: Priority::InteractiveHigh, is_freight: false }
    }
}

impl Net {
    /// Opens a session.
    ///
    /// # Errors
    /// A configuration that cannot be read, that names nobody, or that lets everybody in; no session.
    pub fn open(args: &NetArgs, robot: &str) -> anyhow::Result<Self> {
        let config = config(args)?;
        let session = zenoh::open(config).wait().map_err(|e| anyhow::anyhow!("zenoh: {e}"))?;
        let prefix = format!("nullsweep/{robot}/relay");
        Ok(Self { session, prefix, mouth: Mouth::new("mouth")?, freight: Mouth::new("freight")? })
    }

    fn key(&self, last: &str) -> String {
        format!("{}/{last}", self.prefix)
    }

    /// Says something to whoever listens; it is left out where the network cannot take it.
    pub fn tell(&self, last: &str, bytes: Vec<u8>, priority: Priority) {
        let put = self.session.put(self.key(last), bytes);
        let put = put.congestion_control(CongestionControl::Drop).priority(priority).express(true);
        if let Err(e) = put.wait() {
            tracing::debug!("{last}: {e}");
        }
    }

    /// Hears what is said.
    pub fn hear(
        &self,
        last: &str,
        heard: impl Fn(Vec<u8>) + Send + Sync + 'static,
    ) -> anyhow::Result<()> {
        let listener = self.session.declare_subscriber(self.key(last));
        let listener = listener.callback(move |sample| heard(sample.payload().to_bytes().to_vec()));
        listener.background().wait().map_err(|e| anyhow::anyhow!("zenoh: {last}: {e}"))
    }

    /// Takes questions.
    pub fn take(
        &self,
        last: &str,
        asked: impl Fn(Query) + Send + Sync + 'static,
    ) -> anyhow::Result<Queryable<()>> {
        let queryable = self.session.declare_queryable(self.key(last)).complete(true);
        queryable.callback(asked).wait().map_err(|e| anyhow::anyhow!("zenoh: {last}: {e}"))
    }

    /// Answers one.
    pub fn answer(&self, query: Query, bytes: Vec<u8>) {
        self.mouth.say(move || {
            if let Err(e) = query.reply(query.key_expr().clone(), bytes).wait() {
                tracing::debug!("an answer: {e}");
            }
        });
    }

    /// Asks the other end. `then` is called once: with the answer, or with `None` where none came.
    pub fn ask(
        &self,
        last: &str,
        bytes: impl Into<zenoh::bytes::ZBytes> + Send + 'static,
        manner: Manner,
        then: impl FnOnce(Option<Vec<u8>>) + Send + 'static,
    ) {
        let once = Once(Mutex::new(Some(then)));
        let (session, key) = (self.session.clone(), self.key(last));
        let mouth = if manner.is_freight { &self.freight } else { &self.mouth };
        mouth.say(move || {
            let get = session.get(&key).payload(bytes).timeout(manner.within);
            let get = get.congestion_control(CongestionControl::Block).priority(manner.priority);
            let heard = move |reply: Reply| {
                if let Ok(sample) = reply.result() {
                    once.tell(sample.payload().to_bytes().to_vec());
                }
            };
            if let Err(e) = get.express(true).callback(heard).wait() {
                tracing::debug!("{key}: {e}");
            }
        });
    }
}

/// Calls what is in it once: when there is an answer, or when there will be none.
struct Once<F: FnOnce(Option<Vec<u8>>)>(Mutex<Option<F>>);

impl<F: FnOnce(Option<Vec<u8>>)> Once<F> {
    fn call(&self, answer: Option<Vec<u8>>) {
        let then = self.0.lock().ok().and_then(|mut then| then.take());
        if let Some(then) = then {
            then(answer);
        }
    }

    fn tell(&self, answer: Vec<u8>) {
        self.call(Some(answer));
    }
}

impl<F: FnOnce(Option<Vec<u8>>)> Drop for Once<F> {
    fn drop(&mut self) {
        self.call(None);
    }
}

type Work = Box<dyn FnOnce() + Send>;

/// A thread that says one thing after the other, so that nobody else waits for the network.
#[derive(Clone)]
struct Mouth(Arc<mpsc::Sender<Work>>);

impl Mouth {
    fn new(name: &str) -> anyhow::Result<Self> {
        let (sender, work) = mpsc::channel::<Work>();
        let thread = std::thread::Builder::new().name(name.into());
        thread.spawn(move || work.into_iter().for_each(|work| work())).context("a thread")?;
        Ok(Self(Arc::new(sender)))
    }

    fn say(&self, work: impl FnOnce() + Send + 'static) {
        // The thread lives as long as the sender.
        let _ = self.0.send(Box::new(work));
    }
}

/// zenoh's configuration: the file's, or its defaults and ours, and the endpoints that were given.
fn config(args: &NetArgs) -> anyhow::Result<Config> {
    let set = |config: &mut Config, key: &str, value: &str| {
        config.insert_json5(key, value).map_err(|e| anyhow::anyhow!("zenoh: {key}: {e}"))
    };
    let mut config = match &args.zenoh {
        Some(file) => Config::from_file(file)
            .map_err(|e| anyhow::anyhow!("cannot read {}: {e}", file.display()))?,
        None => {
            let mut config = Config::default();
            for (key, value) in SETTINGS {
                set(&mut config, key, value)?;
            }
            config
        }
    };
    // zenoh's own default is to listen on any port, for anybody.
    let listens = |config: &Config| config.get_json("listen/endpoints").unwrap_or_default();
    if !args.listen.is_empty() {
        set(&mut config, "listen/endpoints", &Value::from(args.listen.clone()).to_string())?;
    } else if listens(&config) == listens(&Config::default()) {
        set(&mut config, "listen/endpoints", "[]")?;
    }
    if !args.connect.is_empty() {
        set(&mut config, "connect/endpoints", &Value::from(args.connect.clone()).to_string())?;
    }
    let listens = endpoints(&listens(&config));
    let connects = endpoints(&config.get_json("connect/endpoints").unwrap_or_default());
    if listens.is_empty() && connects.is_empty() {
        bail!(
            "nobody to speak to: --listen tls/0.0.0.0:7447 at the one end, --connect \
             tls/HOST:7447 at the other, or a file of zenoh's (--zenoh) that says so"
        );
    }
    if let Some(open) =
        listens.iter().find(|endpoint| is_open(endpoint)).filter(|_| !args.unprotected)
    {
        bail!(
            "{open} is without TLS and open to other hosts: whoever reaches it can move the arm; \
             listen on tls/… with certificates (--zenoh), on 127.0.0.1 behind a tunnel, or say \
             --unprotected"
        );
    }
    Ok(config)
}

/// The endpoints in a value of zenoh's configuration, whatever it is nested in.
fn endpoints(json: &str) -> Vec<String> {
    fn collect(value: &Value, all: &mut Vec<String>) {
        match value {
            Value::String(text) => all.push(text.clone()),
            Value::Array(values) => values.iter().for_each(|value| collect(value, all)),
            Value::Object(values) => values.values().for_each(|value| collect(value, all)),
            _ => {}
        }
    }
    let mut all = Vec::new();
    collect(&serde_json::from_str(json).unwrap_or_default(), &mut all);
    all
}

/// Whether others than this host can speak to that endpoint and nothing is asked of them.
fn is_open(endpoint: &str) -> bool {
    let Some((protocol, address)) = endpoint.split_once('/') else { return true };
    if matches!(protocol, "tls" | "quic") || protocol.starts_with("unix") {
        return false;
    }
    let host = address.split(['?', '#']).next().unwrap_or(address);
    let host = host.rsplit_once(':').map_or(host, |(host, _)| host);
    !(host == "localhost" || host == "[::1]" || host.starts_with("127."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(listen: &[&str], connect: &[&str]) -> NetArgs {
        let owned = |all: &[&str]| all.iter().map(ToString::to_string).collect();
        NetArgs { listen: owned(listen), connect: owned(connect), zenoh: None, unprotected: false }
    }

    #[test]
    fn nobody_is_let_in_unasked() {
        for open in ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "udp/10.0.0.1:7447", "tcp/robot:1?rel=0"]
        {
            let why = config(&args(&[open], &[])).unwrap_err().to_string();
            assert!(why.contains(open) && why.contains("--unprotected"), "{why}");
            assert!(config(&NetArgs { unprotected: true, ..args(&[open], &[]) }).is_ok());
        }
        for kept in ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:1", "tls/0.0.0.0:7447"]
        {
            assert!(config(&args(&[kept], &[])).is_ok(), "{kept}");
        }
    }

    #[test]
    fn who_only_connects_does_not_listen() {
        let config = config(&args(&[], &["tcp/10.0.0.2:7447"])).expect("sound");
        let of = |key: &str| endpoints(&config.get_json(key).expect("a key"));
        assert!(of("listen/endpoints").is_empty());
        assert_eq!(of("connect/endpoints"), ["tcp/10.0.0.2:7447"]);
        assert_eq!(config.get_json("scouting/multicast/enabled").expect("a key"), "false");
        let why = super::config(&args(&[], &[])).unwrap_err().to_string();
        assert!(why.starts_with("nobody to speak to"), "{why}");
    }
}
