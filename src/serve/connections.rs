//! Who is connected: not more than can be answered, and nobody who says nothing.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::task::AbortHandle;
use tokio::time::Instant;

/// Connections at a time. A browser has six.
pub const MOST: usize = 128;
/// What a connection may take to say something although others wait for its place: on a busy machine a browser does not
/// get to its request at once.
const GRACE: Duration = Duration::from_millis(200);
/// In which a request must have said what it wants; also how long a connection may lie idle.
const HEAD: Duration = Duration::from_secs(10);
/// What it may take to say so: bytes of a request before its body, and how much of one is held while it is read.
const LARGEST_HEAD: usize = 16 << 10;
const BUFFER: usize = 64 << 10;
/// Before connections are taken again where the system has none to give.
const PAUSE: Duration = Duration::from_millis(500);

/// A connection that is open.
struct Guest {
    /// It has asked for something.
    asked: Arc<AtomicBool>,
    came: Instant,
    task: AbortHandle,
}

/// Where all places are taken: sends away the one who has been silent longest, once its time is over.
async fn make_room(guests: &mut VecDeque<Guest>) {
    loop {
        guests.retain(|guest| !guest.task.is_finished());
        let silent = guests
            .iter()
            .position(|guest| !guest.asked.load(Ordering::Relaxed));
        let Some(at) = silent.filter(|_| guests.len() >= MOST) else {
            return;
        };
        let due = guests[at].came + GRACE;
        if due > Instant::now() {
            tokio::time::sleep_until(due).await;
        } else if let Some(guest) = guests.remove(at) {
            guest.task.abort();
        }
    }
}

/// Answers for ever. Where all places are taken, the one goes who has been silent longest: a crowd that connects and says nothing keeps
/// nobody waiting.
pub async fn serve(listener: TcpListener, router: Router) {
    let places = Arc::new(Semaphore::new(MOST));
    // In the order in which they came.
    let mut guests: VecDeque<Guest> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        make_room(&mut guests).await;
        // The semaphore is never closed.
        let Ok(place) = places.clone().acquire_owned().await else {
            return;
        };
        let asked = Arc::new(AtomicBool::new(false));
        let connection = one(stream, router.clone(), asked.clone());
        let task = tokio::spawn(async move {
            let _place = place;
            connection.await;
        });
        guests.push_back(Guest {
            asked,
            came: Instant::now(),
            task: task.abort_handle(),
        });
        // Who has sent a request already is heard before the next one comes in.
        tokio::task::yield_now().await;
    }
}

async fn one(stream: TcpStream, router: Router, asked: Arc<AtomicBool>) {
    let routes = TowerToHyperService::new(router);
    let service = service_fn(move |request: hyper::Request<Incoming>| {
        asked.store(true, Ordering::Relaxed);
        routes.call(request)
    });
    // What goes wrong between a browser and us is the browser's affair.
    let _ = http1::Builder::new()
        // Who has sent a whole order and leaves has given it all the same.
        .half_close(true)
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD)
        .max_header_size(LARGEST_HEAD)
        .max_buf_size(BUFFER)
        .serve_connection(TokioIo::new(stream), service)
        .await;
}
