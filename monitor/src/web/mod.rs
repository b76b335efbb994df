//! The dashboard in a browser, served by the monitor itself.
//!
//! ```text
//! series    the numbers that are plotted, and which of them a message contributes
//! history   the last minutes of them, thinned without losing a peak
//! board     what all dashboards look at: filled by the monitor's loop, read by the server
//! frame     what is on the board as JSON
//! live      frames to dashboards, twenty times a second
//! guard     who may look, and who may turn knobs
//! knobs     knobs turned over HTTP
//! page      the page's own files
//! server    routes and connections
//! address   where it listens
//! ```
//!
//! The monitor's loop only counts samples into bins, under a lock that is never held for long. Text
//! and sockets are the business of the server's own thread.

mod address;
mod board;
mod browser;
mod frame;
mod guard;
mod history;
mod knobs;
mod live;
mod page;
mod series;
mod server;

use std::{
    io,
    net::{SocketAddr, TcpListener},
    thread,
};

use clap::Args;
use mtj_model::scenario::BusSettings;
use mtj_protocol::{
    bus::{Bus, BusError},
    port::Message,
};
use socket2::SockRef;
use tokio::sync::oneshot;

use self::{
    address::Address,
    guard::{Guard, Token},
    live::{Live, Shared},
    server::Server,
};
use crate::{
    desk::{Counter, Desk},
    monitor::Audience,
};

/// How much of what is sent to a dashboard may wait to be taken: a few seconds' worth.
const SEND_BUFFER: usize = 128 * 1024;

/// The dashboard's part of a command line.
#[derive(Args, Clone, Debug, Default)]
pub struct WebOptions {
    /// Serve a dashboard to browsers at this address, or at the next port that is free
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        default_missing_value = address::DEFAULT
    )]
    pub web: Option<String>,
    /// Open the dashboard in a browser
    #[arg(long)]
    pub open: bool,
    /// A dashboard without knobs
    #[arg(long)]
    pub read_only: bool,
}

impl WebOptions {
    /// Serves the dashboard where nobody has said where.
    pub fn wanted(mut self) -> Self {
        self.web.get_or_insert_with(|| address::DEFAULT.to_owned());
        self
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let address = self.web.iter().flat_map(|address| ["--web".to_owned(), address.clone()]);
        let open = self.open.then(|| "--open".to_owned());
        let read_only = self.read_only.then(|| "--read-only".to_owned());
        address.chain(open).chain(read_only).collect()
    }

    /// Takes the address, before anything else is begun; `None` if no dashboard is wanted.
    pub fn listen(&self) -> Result<Option<Reception>, BusError> {
        let wanted = self.web.as_deref().or(self.open.then_some(address::DEFAULT));
        let Some(text) = wanted else { return Ok(None) };
        let address = Address::parse(text)?;
        let listener = address.listen()?;
        let token = match self.read_only {
            true => None,
            false => Some(Token::draw().map_err(|error| {
                BusError::Transport(format!("no random numbers for a token: {error}").into())
            })?),
        };
        Ok(Some(Reception { address, listener, token, open: self.open }))
    }
}

/// Which session a dashboard shows.
#[derive(Clone, Debug)]
pub struct Place {
    /// Its name.
    pub session: String,
    /// The bus it is on.
    pub bus: String,
}

impl From<&BusSettings> for Place {
    fn from(settings: &BusSettings) -> Self {
        Self { session: settings.session.clone(), bus: settings.kind.name().to_owned() }
    }
}

/// An address where a dashboard will be served.
pub struct Reception {
    address: Address,
    listener: TcpListener,
    token: Option<Token>,
    open: bool,
}

impl Reception {
    /// Where it listens, once a port was found.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Serves a dashboard of a bus, with knobs if they are wanted, to what it adds to an audience.
    pub fn join<'a>(
        self,
        bus: &impl Bus,
        place: &Place,
        audience: &mut Vec<Box<dyn Audience + 'a>>,
    ) -> Result<(), BusError> {
        let counter = match self.token {
            None => None,
            Some(_) => {
                let (desk, counter) = Desk::open(bus)?;
                audience.push(Box::new(desk));
                Some(counter)
            }
        };
        audience.push(Box::new(self.serve(place, counter)?));
        Ok(())
    }

    /// Serves a dashboard of whatever the result hears; without a counter it has no knobs.
    pub fn serve(self, place: &Place, counter: Option<Counter>) -> Result<Dashboards, BusError> {
        let failed =
            |error: io::Error| BusError::Transport(format!("--web: cannot serve: {error}").into());
        let Self { address, listener, token, open } = self;
        let token = token.filter(|_| counter.is_some());
        let local = listener.local_addr().map_err(failed)?;
        let url = address.url(local) + &fragment(token.as_ref());
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        // What a dashboard does not read must not pile up in the kernel either.
        SockRef::from(&listener).set_send_buffer_size(SEND_BUFFER).map_err(failed)?;
        let listener = {
            let _entered = runtime.enter();
            tokio::net::TcpListener::from_std(listener).map_err(failed)?
        };
        let board = Shared::default();
        let hello = frame::hello(place, token.is_none());
        let live = Live::new(board.clone(), hello);
        let server = Server { guard: Guard { name: address.host, token }, counter, live };
        let (until, stopped) = oneshot::channel::<()>();
        let serve = move || {
            runtime.block_on(async {
                tokio::select! { () = server.serve(listener) => {}, _ = stopped => {} }
            });
        };
        thread::Builder::new().name("dashboards".to_owned()).spawn(serve).map_err(failed)?;
        eprintln!("mtj monitor: dashboard at {url}");
        if !local.ip().is_loopback() {
            eprintln!(
                "mtj monitor: anybody who reaches {local} over the network can watch; knobs take the token"
            );
        }
        if open {
            browser::open(&url);
        }
        Ok(Dashboards { board, _until: until })
    }
}

/// The part of the address that a browser keeps to itself.
fn fragment(token: Option<&Token>) -> String {
    token.map(|token| format!("#token={}", token.words())).unwrap_or_default()
}

/// All dashboards: they hear what is said as long as this lives.
pub struct Dashboards {
    board: Shared,
    /// The server ends when this is dropped.
    _until: oneshot::Sender<()>,
}

impl Dashboards {
    /// What dashboards would show, if there were any: no server, no address.
    pub fn unseen() -> Self {
        Self { board: Shared::default(), _until: oneshot::channel().0 }
    }
}

impl Audience for Dashboards {
    fn hear(&mut self, message: &Message) {
        self.board.lock().hear(message);
    }
}
