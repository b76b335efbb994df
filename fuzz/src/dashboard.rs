//! The server of the dashboard, over a real connection.

use std::{
    io::{Read, Write},
    net::{Shutdown, SocketAddr, TcpStream},
    sync::{Mutex, OnceLock},
    time::Duration,
};

use mtj_monitor::web::{SessionInfo, WebDashboard, WebOptions};

/// How long the server may take to end a connection that its client has ended.
const PATIENCE: Duration = Duration::from_secs(20);

/// Whatever a browser sends, the server answers or ends the connection, and is there for the next
/// one.
pub fn dashboard(data: &[u8]) {
    let Ok(mut browser) = TcpStream::connect(server().address) else {
        panic!("the server takes no connections any more");
    };
    let mut said = Vec::new();
    let outcome = browser
        .set_read_timeout(Some(PATIENCE))
        .and_then(|()| browser.write_all(data))
        .and_then(|()| browser.shutdown(Shutdown::Write))
        .and_then(|()| browser.read_to_end(&mut said));
    // It may end the connection before it has heard all, but not keep it.
    if let Err(error) = outcome {
        assert!(error.kind() != std::io::ErrorKind::WouldBlock, "no end within {PATIENCE:?}");
    }
    assert!(said.is_empty() || said.starts_with(b"HTTP/1."), "no answer: {said:?}");
}

struct Server {
    address: SocketAddr,
    /// It serves as long as this lives.
    _dashboard: Mutex<WebDashboard>,
}

fn server() -> &'static Server {
    static SERVER: OnceLock<Server> = OnceLock::new();
    SERVER.get_or_init(|| start().unwrap_or_else(|error| panic!("no dashboard: {error}")))
}

fn start() -> Result<Server, Box<dyn std::error::Error>> {
    let options = WebOptions { web: Some("127.0.0.1:0".to_owned()), ..WebOptions::default() };
    let listener = options.listen()?.ok_or("no address")?;
    let address = listener.address()?;
    let session = SessionInfo { session: "fuzz".to_owned(), bus: "local".to_owned() };
    Ok(Server { address, _dashboard: Mutex::new(listener.serve(&session, None)?) })
}
