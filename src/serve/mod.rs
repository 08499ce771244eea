//! A local page for one campaign: HTTP on the loopback address, one job at a time, nothing from outside.
//!
//! What the page shows and does is a [`PageSubject`], how it gets one an [`Entrance`]; this module knows only browsers.
//! `connections` takes them, `guard` says who may ask, `desk` does one job after the other and tells how far it is,
//! `routes` is what can be asked for.

mod connections;
mod desk;
mod guard;
mod refusal;
mod routes;
mod server;
mod subject;

pub(crate) use desk::locked;
pub use desk::{Job, JobStage};
pub use refusal::Refusal;
pub use server::Server;
pub use subject::{
    Entrance, EntranceRequest, PageOrder, PageScene, PageSubject, Parcel, Reply, Report, Wish,
};
