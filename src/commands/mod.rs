//! The command line: one file a subcommand, each reads its arguments, calls the library and hands back
//! an [`Outcome`]. Nothing is computed here.

pub(crate) mod begin;
mod campaign_args;
mod cli;
pub(crate) mod document;
pub(crate) mod find;
pub(crate) mod grow;
pub(crate) mod many;
pub(crate) mod measure;
mod next_step;
mod outcome;
mod printed;
mod program;
mod progress_bar;
mod range;
mod relaunch;
mod text;
pub(crate) mod write;

pub(crate) use campaign_args::{CampaignArg, SideArgs, by_domain, side};
pub use cli::{Cli, run};
pub use outcome::Outcome;
pub use printed::{shown, shown_json};
pub use program::program;
pub use relaunch::started_by;
