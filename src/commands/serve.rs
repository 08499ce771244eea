//! `lobestone serve [DIR]`: the campaign as a page in a browser.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;

use serde_json::{Value, json};

use super::entrance::Drafting;
use super::text::Emphasis;
use super::workbench::CampaignBench;
use super::{Outcome, bench_worker};
use crate::serve::{PageScene, Server};
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
#[command(
    after_help = "Without a folder the page begins with choosing one on this computer, or with files dropped on it, and helps to \
                  write campaign.toml. Then it shows the report, diagnoses, adds an effect or takes it back, and shows the \
                  error fall. It can be reached from this computer only (127.0.0.1), and only with the whole address: that \
                  carries a secret, so do not pass it on. Ctrl-C ends it; whatever was recorded until then stays.\n\n\
                  Examples:\n  lobestone serve --open\n  lobestone serve cell7"
)]
pub struct ServeArgs {
    /// The campaign folder (with campaign.toml in it); without one it is chosen on the page.
    dir: Option<PathBuf>,
    /// Port on this computer; 0: any that is free.
    #[arg(long, default_value_t = 8017)]
    port: u16,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
    /// Do the page's work on the folder, as told on standard input.
    #[arg(long, hide = true, requires = "dir")]
    worker: bool,
}

/// Says the address at once and comes back when it is told to end.
pub fn run(args: ServeArgs, as_json: bool) -> Result<Outcome> {
    if let (true, Some(dir)) = (args.worker, &args.dir) {
        bench_worker::work(dir)?;
        return Ok(Outcome {
            json: Value::Null,
            text: String::new(),
            failed: None,
        });
    }
    let (scene, dir) = match &args.dir {
        Some(dir) => {
            let bench = CampaignBench::open(dir)?;
            let dir = bench.dir().to_path_buf();
            (PageScene::Bench(Arc::new(bench)), Some(dir))
        }
        None => (PageScene::Entrance(Arc::new(Drafting::default())), None),
    };
    let server = Server::bind(scene, args.port)?;
    let url = server.url();
    let said = match as_json {
        true => format!(
            "{}\n",
            json!({ "url": url, "port": server.address().port(), "dir": dir })
        ),
        false => format!(
            "{} {url}\n(this computer only, and only who knows the whole address; Ctrl-C ends it)\n",
            Emphasis::Strong.on("Open in a browser:")
        ),
    };
    let mut stdout = anstream::stdout();
    stdout
        .write_all(said.as_bytes())
        .and_then(|()| stdout.flush())
        .map_err(|e| Error::computation(format!("the address cannot be printed: {e}")))?;
    // Lives as long as the server: a browser may take its time.
    let _shown = match args.open {
        true => match open(&url) {
            Ok(file) => Some(file),
            Err(error) => {
                anstream::eprintln!("{error}");
                None
            }
        },
        false => None,
    };
    server.run()?;
    Ok(Outcome {
        // Said already.
        json: Value::Null,
        text: "ended; what was recorded is in the campaign's folder\n".into(),
        failed: None,
    })
}

/// Has the browser open `url`. What a program is called with everybody on the computer can read, so the browser is given a
/// file of ours alone that leads there.
fn open(url: &str) -> Result<tempfile::TempPath> {
    let failed = |e: std::io::Error| -> Error {
        InputError::new(format!("no browser could be started: {e}"))
            .key("--open")
            .remedy("open the address above in a browser yourself")
            .into()
    };
    let mut file = tempfile::Builder::new()
        .prefix("lobestone-")
        .suffix(".html")
        .tempfile()
        .map_err(failed)?;
    writeln!(
        file,
        "<!DOCTYPE html><meta charset=\"utf-8\"><title>lobestone</title><meta http-equiv=\"refresh\" content=\"0;url={url}\">\
         <p><a href=\"{url}\">To lobestone</a></p>"
    )
    .map_err(failed)?;
    let path = file.into_temp_path();
    let mut command = match () {
        () if cfg!(target_os = "macos") => Command::new("open"),
        () if cfg!(windows) => {
            let mut explorer = Command::new("cmd");
            explorer.args(["/C", "start", ""]);
            explorer
        }
        () => Command::new("xdg-open"),
    };
    command
        .arg(&path)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .map_err(failed)?;
    Ok(path)
}
