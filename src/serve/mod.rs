//! A local page for one campaign: HTTP on the loopback address, one job at a time, nothing from outside.
//!
//! What the page shows and does is a [`Workbench`], how it gets one an [`Entrance`]; this module knows only browsers.
//! `connections` takes them, `guard` says who may ask, `desk` does one job after the other and tells how far it is,
//! `routes` is what can be asked for.

mod connections;
mod desk;
mod guard;
mod routes;

use std::collections::HashMap;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(crate) use desk::locked;
pub use desk::{Job, Stage};
use guard::Guard;

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

/// Where a page begins that is about no campaign yet: a folder is looked for, or made of what is dropped on the page, and a
/// campaign file is written for it.
pub trait Entrance: Send + Sync + 'static {
    /// # Errors
    /// Why it cannot be done.
    fn answer(&self, request: Request) -> Result<Reply>;

    /// Puts a new file into a folder that was made or looked at before.
    ///
    /// # Errors
    /// Another folder, a name that leaves it or is taken, more than there is room for.
    fn receive(&self, parcel: &Parcel, content: &[u8]) -> Result<()>;
}

/// What is asked of an [`Entrance`].
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum Request {
    /// What lies in a folder; `None`: where to begin.
    Look { folder: Option<String> },
    /// A new folder.
    Folder { parent: PathBuf, name: String },
    /// A campaign file for a folder, as far as it is known.
    Draft { wish: Wish },
    /// The same, written.
    Write { wish: Wish },
    /// The page is about this campaign from now on.
    Open { dir: PathBuf },
    /// The page is about no campaign any more.
    Leave {},
}

/// The campaign file that is wanted.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wish {
    pub dir: PathBuf,
    /// `None`: the folder's.
    pub name: Option<String>,
    /// Table (`cut`, `cut 01`), key and value as typed.
    pub answers: Vec<(String, String, String)>,
    /// Files that are no part of it.
    pub left_out: Vec<String>,
    /// A list of cuts in the folder; empty: none; `None`: the usual one.
    pub cut_list: Option<String>,
    /// Read all files again.
    pub again: bool,
}

/// Where a file belongs that is dropped on the page.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parcel {
    pub folder: PathBuf,
    /// Path from there, with forward slashes.
    pub name: String,
}

/// What an [`Entrance`] answers.
pub enum Reply {
    Told(Value),
    Opened(Arc<dyn Workbench>),
    Left,
}

/// What a click asks for. `head`: the mark of the log ([`crate::revision::RevisionLog::mark`]) that the page showed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
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

/// What the page is about, or how it gets there.
pub enum Scene {
    Bench(Arc<dyn Workbench>),
    Entrance(Arc<dyn Entrance>),
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

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Late(why) | Refusal::Impossible(why) => Error::Computation(why),
        }
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
    guard: Guard,
    scene: Scene,
}

impl Server {
    /// Takes a port of the loopback address; 0: any that is free.
    ///
    /// # Errors
    /// The port is taken or not allowed.
    pub fn bind(scene: Scene, port: u16) -> Result<Self> {
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
            guard: Guard::new(address),
            scene,
        })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to type into a browser; whoever knows it may do everything.
    pub fn url(&self) -> String {
        format!("http://{}{}", self.address, self.guard.page())
    }

    /// Answers until the program is told to end (Ctrl-C, SIGTERM). A job that is being done then is given up; a file
    /// that is being written is written to its end.
    ///
    /// # Errors
    /// The operating system refuses what a server needs.
    pub fn run(self) -> Result<()> {
        let failed = |e: std::io::Error| Error::computation(format!("the server cannot go on: {e}"));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(failed)?;
        let (router, stand) = routes::router(self.scene, self.guard);
        let listener = self.listener;
        let done = runtime.block_on(async {
            listener.set_nonblocking(true)?;
            let listener = tokio::net::TcpListener::from_std(listener)?;
            tokio::select! {
                () = connections::serve(listener, router) => Ok(()),
                told = told_to_end() => told,
            }
        });
        if let Some(bench) = stand.bench() {
            bench.settle();
        }
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
