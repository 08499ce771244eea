//! The server: takes a port, answers until it is told to end.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};

use super::guard::Guard;
use super::subject::PageScene;
use super::{connections, routes};
use crate::{Error, InputError, Result};

/// A server that has its address, but does not answer yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    guard: Guard,
    scene: PageScene,
}

impl Server {
    /// Takes a port of the loopback address; 0: any that is free.
    ///
    /// # Errors
    /// The port is taken or not allowed.
    pub fn bind(scene: PageScene, port: u16) -> Result<Self> {
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
