use super::Outcome;
use crate::{Error, Result};

#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: Args) -> Result<Outcome> {
    Err(Error::computation("inspect is not built yet"))
}
