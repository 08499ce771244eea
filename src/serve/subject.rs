//! What a page is about and what it asks for: all that the server knows of campaigns.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::desk::Job;
use super::refusal::Refusal;
use crate::Result;
use crate::revision::Side;

/// What the page is about.
pub trait PageSubject: Send + Sync + 'static {
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
    fn prepare(self: Arc<Self>, order: PageOrder) -> std::result::Result<Job, Refusal>;

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
    fn answer(&self, request: EntranceRequest) -> Result<Reply>;

    /// Puts a new file into a folder that was made or looked at before.
    ///
    /// # Errors
    /// Another folder, a name that leaves it or is taken, more than there is room for.
    fn receive(&self, parcel: &Parcel, content: &[u8]) -> Result<()>;
}

/// What is asked of an [`Entrance`].
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum EntranceRequest {
    /// What lies in a folder; `None`: where to begin.
    Look { folder: Option<String> },
    /// A new folder.
    Folder { parent: PathBuf, name: String },
    /// A campaign file for a folder, as far as it is known.
    Draft { wish: Wish },
    /// How far the files of a folder are read, while that is being done.
    Reading { dir: PathBuf },
    /// Reading the files of a folder ends: nobody waits for it any more.
    Stop { dir: PathBuf },
    /// The same as a draft, written.
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
    Opened(Arc<dyn PageSubject>),
    Left,
}

/// What a click asks for. `head`: the mark of the log ([`crate::revision::RevisionLog::mark`]) that the page showed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub enum PageOrder {
    Refresh {},
    Diagnose {
        side: Side,
    },
    Add {
        side: Side,
        head: String,
        effect: String,
    },
    Undo {
        side: Side,
        head: String,
    },
}

/// What the page is about, or how it gets there.
pub enum PageScene {
    Bench(Arc<dyn PageSubject>),
    Entrance(Arc<dyn Entrance>),
}

/// A page with its pictures.
pub struct Report {
    pub html: String,
    /// By the name under which the page offers them.
    pub images: HashMap<String, Vec<u8>>,
}
