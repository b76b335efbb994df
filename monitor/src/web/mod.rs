//! The dashboard in a browser, served by the monitor itself.
//!
//! ```text
//! series     the numbers that are plotted, and which of them a message contributes
//! history    the last minutes of them: minimum and maximum of each bin
//! store      what dashboards show: filled by the monitor's loop, read by the server
//! page_json  the messages to a page, as JSON
//! broadcast  sends updates of the store to all dashboards, twenty times a second
//! access     who may watch, and who may send requests
//! host_names the names under which browsers reach the server
//! token      the secret that a request needs
//! requests   requests over HTTP
//! saving     requests to save the last seconds over HTTP
//! page       the page's own files
//! server     routes and connections
//! address    the address at which it listens
//! browser    opens the page in the user's browser
//! error      why the dashboard cannot be served
//! ```
//!
//! The monitor's loop only counts samples into bins, under a lock that is held for moments. The
//! server's own thread makes the text and writes to the sockets.

mod access;
mod address;
mod broadcast;
mod browser;
mod error;
mod history;
mod host_names;
mod page;
mod page_json;
mod requests;
mod saving;
mod series;
mod server;
mod store;
mod token;

use std::{
    fmt, io,
    net::{SocketAddr, TcpListener},
    path::PathBuf,
    thread,
};

use clap::Args;
use mtj_model::scenario::BusSettings;
use mtj_protocol::{bus::Bus, port::Message};
use socket2::SockRef;
use tokio::sync::oneshot;
use tracing::{info, warn};

use self::{
    access::AccessControl,
    address::Address,
    broadcast::{Broadcaster, SharedStore},
    host_names::HostNames,
    server::Server,
    token::Token,
};
pub use self::{error::WebError, token::TokenFileError};
use crate::{
    error::MonitorError,
    monitor::Sink,
    recording::SaveHandle,
    requests::{RequestHandle, RequestQueue},
};

/// How many bytes may wait in the kernel for one dashboard: a few seconds of data.
const SEND_BUFFER: usize = 128 * 1024;

/// The options of the dashboard.
#[derive(Args, Clone, Debug, Default)]
pub struct WebOptions {
    /// Serve a dashboard to browsers at this address, or at the next port that is free
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        default_missing_value = error::DEFAULT
    )]
    pub web: Option<String>,
    /// A further name under which browsers reach this machine, like robot.lab; may be repeated
    #[arg(long, value_name = "NAME")]
    pub web_host: Vec<String>,
    /// Take the dashboard's token from this file, so that it survives a restart; without, each
    /// start has a new one
    #[arg(long, value_name = "FILE", conflicts_with = "read_only")]
    pub web_token_file: Option<PathBuf>,
    /// Open the dashboard in a browser
    #[arg(long)]
    pub open: bool,
    /// A dashboard without knobs
    #[arg(long)]
    pub read_only: bool,
}

impl WebOptions {
    /// Serves the dashboard at the default address unless the user has given one.
    pub fn wanted(mut self) -> Self {
        self.web.get_or_insert_with(|| error::DEFAULT.to_owned());
        self
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let address = self.web.iter().flat_map(|address| ["--web".to_owned(), address.clone()]);
        let hosts = self.web_host.iter().flat_map(|name| ["--web-host".to_owned(), name.clone()]);
        let file = self.web_token_file.iter();
        let file =
            file.flat_map(|path| ["--web-token-file".to_owned(), path.display().to_string()]);
        let open = self.open.then(|| "--open".to_owned());
        let read_only = self.read_only.then(|| "--read-only".to_owned());
        address.chain(hosts).chain(file).chain(open).chain(read_only).collect()
    }

    /// Listens at the address, so that an error comes before anything else starts; `None` if the
    /// user wants no dashboard.
    pub fn listen(&self) -> Result<Option<WebListener>, WebError> {
        let wanted = self.web.as_deref().or(self.open.then_some(error::DEFAULT));
        let Some(text) = wanted else { return self.without_dashboard() };
        let address = Address::parse(text)?;
        let names =
            HostNames::of_this_machine().with(&address.host).with_options(&self.web_host)?;
        let token = self.token()?;
        let listener = address.listen()?;
        let token_file = self.web_token_file.clone();
        let (saves, open) = (None, self.open);
        Ok(Some(WebListener { address, names, listener, token, token_file, saves, open }))
    }

    /// Nothing to serve, which must be what the other options mean, too.
    fn without_dashboard(&self) -> Result<Option<WebListener>, WebError> {
        let options = [
            ("--web-host", !self.web_host.is_empty()),
            ("--web-token-file", self.web_token_file.is_some()),
        ];
        match options.into_iter().find(|(_, is_given)| *is_given) {
            None => Ok(None),
            Some((option, _)) => Err(WebError::WithoutDashboard { option }),
        }
    }

    /// The token that requests need; `None` if there are to be none.
    fn token(&self) -> Result<Option<Token>, WebError> {
        Ok(match (&self.web_token_file, self.read_only) {
            (_, true) => None,
            (Some(path), false) => Some(Token::read(path)?),
            (None, false) => Some(Token::new().map_err(WebError::Token)?),
        })
    }
}

/// The session that a dashboard shows.
#[derive(Clone, Debug)]
pub struct SessionInfo {
    /// Its name.
    pub session: String,
    /// The name of its bus.
    pub bus: String,
}

impl From<&BusSettings> for SessionInfo {
    fn from(settings: &BusSettings) -> Self {
        Self { session: settings.session.clone(), bus: settings.kind.name().to_owned() }
    }
}

/// A socket that listens, without a dashboard yet.
#[derive(Debug)]
pub struct WebListener {
    address: Address,
    names: HostNames,
    listener: TcpListener,
    token: Option<Token>,
    /// The file that the token is from.
    token_file: Option<PathBuf>,
    saves: Option<SaveHandle>,
    open: bool,
}

impl WebListener {
    /// The address at which it listens.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Lets dashboards save what a recorder keeps, if one does.
    pub fn saving(self, saves: Option<SaveHandle>) -> Self {
        Self { saves, ..self }
    }

    /// Adds a dashboard to the sinks of a monitor; unless it is read-only, it can send requests to
    /// the plant over `bus`.
    pub fn serve_bus<'a>(
        self,
        bus: &impl Bus,
        session: &SessionInfo,
        sinks: &mut Vec<Box<dyn Sink + 'a>>,
    ) -> Result<(), MonitorError> {
        let mut requests = None;
        if self.token.is_some() {
            let (queue, handle) = RequestQueue::open(bus)?;
            sinks.push(Box::new(queue));
            requests = Some(handle);
        }
        sinks.push(Box::new(self.serve(session, requests)?));
        Ok(())
    }

    /// Serves a dashboard of all messages that the result gets; without `requests` it is read-only.
    pub fn serve(
        self,
        session: &SessionInfo,
        requests: Option<RequestHandle>,
    ) -> Result<WebDashboard, WebError> {
        let Self { address, names, listener, token, token_file, saves, open } = self;
        let token = token.filter(|_| requests.is_some());
        let local = listener.local_addr().map_err(WebError::Serve)?;
        let page = address.url(local);
        let url = page.clone() + &fragment(token.as_ref());
        let store = SharedStore::default();
        let is_read_only = token.is_none();
        let hello = page_json::hello(session, is_read_only, saves.is_some());
        let live = Broadcaster::new(store.clone(), hello);
        let access = AccessControl { names, token };
        let server = Server { access, requests, saves, live };
        let stop = start(listener, server).map_err(WebError::Serve)?;
        match (&token_file, is_read_only) {
            // A log may be kept for long, and so may this token.
            (Some(path), false) => {
                info!("dashboard at {page}; knobs take the token in {}", path.display());
            }
            _ => info!("dashboard at {url}"),
        }
        if !local.ip().is_loopback() {
            warn!("anybody who reaches {local} over the network can watch; knobs take the token");
        }
        if open {
            browser::open(&url);
        }
        Ok(WebDashboard { store, _stop: stop })
    }
}

/// Starts the server on a thread of its own; it ends when the result is dropped.
fn start(listener: TcpListener, server: Server) -> io::Result<oneshot::Sender<()>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    listener.set_nonblocking(true)?;
    // Data that a dashboard does not read must not pile up in the kernel.
    SockRef::from(&listener).set_send_buffer_size(SEND_BUFFER)?;
    let listener = {
        let _entered = runtime.enter();
        tokio::net::TcpListener::from_std(listener)?
    };
    let (stop, stopped) = oneshot::channel::<()>();
    let serve = move || {
        runtime.block_on(async {
            tokio::select! { () = server.serve(listener) => {}, _ = stopped => {} }
        });
    };
    thread::Builder::new().name("dashboards".to_owned()).spawn(serve)?;
    Ok(stop)
}

/// The token as a fragment of the URL: browsers do not send fragments to servers.
fn fragment(token: Option<&Token>) -> String {
    token.map(|token| format!("#token={}", token.as_str())).unwrap_or_default()
}

/// A sink whose messages all connected dashboards show, until it is dropped.
pub struct WebDashboard {
    store: SharedStore,
    /// The server ends when this is dropped.
    _stop: oneshot::Sender<()>,
}

impl fmt::Debug for WebDashboard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WebDashboard").finish_non_exhaustive()
    }
}

impl WebDashboard {
    /// A dashboard without a server, for tests of what it does with messages.
    pub fn detached() -> Self {
        Self { store: SharedStore::default(), _stop: oneshot::channel().0 }
    }
}

impl Sink for WebDashboard {
    fn handle(&mut self, message: &Message) {
        self.store.lock().handle(message);
    }
}
