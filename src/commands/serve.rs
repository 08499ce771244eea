//! `lobestone serve DIR`: the campaign as a page in a browser.

use std::io::Write;
use std::sync::Arc;

use serde_json::{Value, json};

use super::text::Emphasis;
use super::workbench::CampaignBench;
use super::{CampaignArg, Outcome};
use crate::serve::Server;
use crate::{Error, Result};

#[derive(clap::Args)]
#[command(
    after_help = "The page shows the report, diagnoses, adds an effect or takes it back, and shows the error fall. It can be \
                  reached from this computer only (127.0.0.1), and only by its own page. Ctrl-C ends it; whatever was \
                  recorded until then stays."
)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Port on this computer; 0: any that is free.
    #[arg(long, default_value_t = 8017)]
    port: u16,
}

/// Says the address at once and comes back when it is told to end.
pub fn run(args: Args, as_json: bool) -> Result<Outcome> {
    let bench = CampaignBench::open(&args.campaign.dir)?;
    let dir = bench.dir().to_path_buf();
    let server = Server::bind(Arc::new(bench), args.port)?;
    let url = server.url();
    let said = match as_json {
        true => format!(
            "{}\n",
            json!({ "url": url, "port": server.address().port(), "dir": dir })
        ),
        false => format!(
            "{} {url}\n(this computer only; Ctrl-C ends it)\n",
            Emphasis::Strong.on("Open in a browser:")
        ),
    };
    let mut stdout = anstream::stdout();
    stdout
        .write_all(said.as_bytes())
        .and_then(|()| stdout.flush())
        .map_err(|e| Error::computation(format!("the address cannot be printed: {e}")))?;
    server.run()?;
    Ok(Outcome {
        // Said already.
        json: Value::Null,
        text: "ended; what was recorded is in the campaign's folder\n".into(),
        failed: None,
    })
}
