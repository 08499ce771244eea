//! Air, cut and steady cut of a force record, in blocks of whole revolutions.

use std::ops::Range;

use crate::cutting::CutAnalysis;
use crate::data::{Process, Sample, TimeRecord};

const MOST_STEADY_BLOCKS: usize = 40;
const MOST_AIR_BLOCKS: usize = 20;
const MOST_DRILLING_BLOCKS: usize = 120;

/// The record cut into blocks of whole revolutions.
pub(crate) struct Windows {
    before: Option<Range<usize>>,
    after: Option<Range<usize>>,
    pub(crate) steady: Range<usize>,
    /// In samples, not whole in general: air before, cut, air after.
    pub(crate) blocks: Vec<[f64; 2]>,
    block_kinds: [usize; 3],
    /// Blocks of the cut before the steady ones.
    entering: usize,
    pub(crate) middle_s: f64,
}

impl Windows {
    pub(crate) fn new<S: Sample>(analysis: &CutAnalysis, record: &TimeRecord<S>, per_turn: f64) -> Windows {
        let rate = record.sample_rate_hz;
        let sample = |t: f64| (((t - record.start_s) * rate).round().max(0.0) as usize).min(record.len());
        let range = |s: [f64; 2]| sample(s[0])..sample(s[1]);
        let steady = range(analysis.steady_s);
        let before = analysis.air_before_s.map(range).filter(|r| !r.is_empty());
        let after = analysis.air_after_s.map(range).filter(|r| !r.is_empty());
        let drilling = analysis.process == Process::Drilling;
        // Equal blocks of whole revolutions that end where the range ends (`back`) or begin where it begins.
        let split = |r: Range<usize>, most: usize| -> Vec<[f64; 2]> {
            let turns = (r.len() as f64 / per_turn + 1e-6).floor();
            let per_block = (turns / most as f64).ceil().max(1.0) * per_turn;
            let count = (r.len() as f64 / per_block + 1e-6).floor() as usize;
            (0..count)
                .map(|k| {
                    [
                        r.start as f64 + k as f64 * per_block,
                        r.start as f64 + (k + 1) as f64 * per_block,
                    ]
                })
                .collect()
        };
        let air = |r: &Option<Range<usize>>| r.clone().map_or(Vec::new(), |r| split(r, MOST_AIR_BLOCKS));
        let (first, last) = (air(&before), air(&after));
        let (cut, entering) = if drilling {
            let from = before.as_ref().map_or(0, |r| r.end);
            let cut = split(from..steady.end, MOST_DRILLING_BLOCKS);
            let entering = cut.iter().filter(|b| b[0] < steady.start as f64).count();
            (cut, entering)
        } else {
            (split(steady.clone(), MOST_STEADY_BLOCKS), 0)
        };
        let block_kinds = [first.len(), cut.len(), last.len()];
        Windows {
            before,
            after,
            steady,
            blocks: first.into_iter().chain(cut).chain(last).collect(),
            block_kinds,
            entering,
            middle_s: record.start_s + 0.5 * record.len() as f64 / rate,
        }
    }

    pub(crate) fn air(&self) -> impl Iterator<Item = Range<usize>> {
        self.before.iter().chain(&self.after).cloned()
    }

    pub(crate) fn steady_blocks(&self) -> Range<usize> {
        self.block_kinds[0] + self.entering..self.block_kinds[0] + self.block_kinds[1]
    }

    pub(crate) fn is_cut(&self, block: usize) -> bool {
        (self.block_kinds[0]..self.block_kinds[0] + self.block_kinds[1]).contains(&block)
    }

    pub(crate) fn block_s<S>(&self, record: &TimeRecord<S>) -> Vec<[f64; 2]> {
        let seconds = |s: f64| record.start_s + s / record.sample_rate_hz - self.middle_s;
        self.blocks.iter().map(|b| b.map(seconds)).collect()
    }
}
