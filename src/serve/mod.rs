//! A local page for one campaign: HTTP on the loopback address, one job at a time, nothing from outside.
//!
//! What the page shows and does is a [`Workbench`]; this module knows only browsers. `guard` says who may ask,
//! `desk` does one job after the other and tells how far it is, `routes` is what can be asked for.

mod desk;
mod guard;
mod routes;

use std::collections::HashMap;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

pub use desk::{Job, Stage};

use crate::revision::Domain;
use crate::{Error, InputError, Result};

/// What the page is about.
pub trait Workbench: Send + Sync + 'static {
    /// The page's title.
    fn title(&self) -> String;

    /// Another text whenever what lies in the folder was changed, by whomever. Cheap: asked for twice a second.
    fn stamp(&self) -> String;

    /// What the page shows. An error is shown, too.
    ///
    /// # Errors
    /// A campaign that cannot be read.
    fn state(&self) -> Result<Value>;

    /// The job of an order; quick, the job itself may take its time.
    ///
    /// # Errors
    /// Why the order is not taken.
    fn prepare(self: Arc<Self>, order: Order) -> std::result::Result<Job, Refusal>;

    /// The report as it was drawn last.
    fn report(&self) -> Option<Arc<Report>>;

    /// Called when the server ends: returns when no file is being written, and from then on none is.
    fn settle(&self);
}

/// What a click asks for. `head`: the mark of the log ([`crate::revision::RevisionLog::mark`]) that the page showed.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum Order {
    Refresh {},
    Diagnose {
        side: Domain,
    },
    Add {
        side: Domain,
        head: String,
        effect: String,
    },
    Undo {
        side: Domain,
        head: String,
    },
}

/// Why an order is not taken, in a sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// Something else is being done, or was done since the page was looked at.
    Late(String),
    /// It cannot be done.
    Impossible(String),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Refusal::Impossible(error.to_string())
    }
}

/// A page with its pictures.
pub struct Report {
    pub html: String,
    /// By the name under which the page offers them.
    pub images: HashMap<String, Vec<u8>>,
}

/// A server that has its address, but does not answer yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    bench: Arc<dyn Workbench>,
}

impl Server {
    /// Takes a port of the loopback address; 0: any that is free.
    ///
    /// # Errors
    /// The port is taken or not allowed.
    pub fn bind(bench: Arc<dyn Workbench>, port: u16) -> Result<Self> {
        let refused = |e: std::io::Error| -> Error {
            InputError::new(format!("port {port} cannot be had: {e}"))
                .key("--port")
                .remedy("--port 0 takes any that is free")
                .into()
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Server {
            listener,
            address,
            bench,
        })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to type into a browser.
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Answers until the program is told to end (Ctrl-C, SIGTERM). A job that is being done then is given up; a file
    /// that is being written is written to its end.
    ///
    /// # Errors
    /// The operating system refuses what a server needs.
    pub fn run(self) -> Result<()> {
        let Server {
            listener,
            address,
            bench,
        } = self;
        let failed = |e: std::io::Error| Error::computation(format!("the server cannot go on: {e}"));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(failed)?;
        let router = routes::router(bench.clone(), address);
        let done = runtime.block_on(async {
            listener.set_nonblocking(true)?;
            let listener = tokio::net::TcpListener::from_std(listener)?;
            tokio::select! {
                ended = async { axum::serve(listener, router).await } => ended,
                told = told_to_end() => told,
            }
        });
        bench.settle();
        // Requests that wait for a file do not hold the end up.
        runtime.shutdown_background();
        done.map_err(failed)
    }
}

async fn told_to_end() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        tokio::select! {
            told = tokio::signal::ctrl_c() => told,
            _ = terminate.recv() => Ok(()),
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await
}
