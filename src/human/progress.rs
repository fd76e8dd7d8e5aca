//! Progress and warnings of a run on standard error, and the request to stop.

use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use pointmill_converter::{Events, Phase, Warning};
use serde_json::json;

use super::quantities::{bytes, count, rate, seconds};
use crate::args::{ProgressArg, TalkArgs};
use crate::exit::print_line;
use crate::flags;
use crate::interrupt;
use crate::printable::json_escaped;

/// Interval of JSON lines; one per batch would be thousands.
const JSON_INTERVAL: Duration = Duration::from_millis(500);
/// Maximum warnings printed; the report has all of them.
const MAX_WARNINGS: u64 = 20;

enum Face {
    Bar(ProgressBar),
    Json,
    Silent,
}

/// Reports phases, rates and warnings on standard error; standard output is for results.
pub(crate) struct Progress {
    face: Face,
    quiet: bool,
    warnings: AtomicU64,
    stop: Option<&'static AtomicBool>,
    done: AtomicU64,
    state: Mutex<State>,
}

struct State {
    phase: &'static str,
    total: u64,
    began: Instant,
    last_json: Instant,
}

impl Progress {
    /// `stop`: the flag that asks the run to stop, if it can.
    pub(crate) fn new(talk: &TalkArgs, stop: Option<&'static AtomicBool>) -> Self {
        let bar = || Face::Bar(ProgressBar::no_length());
        let face = match talk.progress {
            ProgressArg::Json => Face::Json,
            ProgressArg::None => Face::Silent,
            ProgressArg::Bar => bar(),
            ProgressArg::Auto if talk.quiet || !io::stderr().is_terminal() => Face::Silent,
            ProgressArg::Auto => bar(),
        };
        let now = Instant::now();
        Self {
            face,
            quiet: talk.quiet,
            warnings: AtomicU64::new(0),
            stop,
            done: AtomicU64::new(0),
            state: Mutex::new(State { phase: "start", total: 0, began: now, last_json: now }),
        }
    }

    /// A phase begins; `total` counts points (scans where headers are read), 0 is unknown.
    pub(crate) fn begin(&self, phase: &'static str, total: u64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.phase != "start" {
            self.write_json(&mut state); // the last figures of the phase that ends
        }
        self.done.store(0, Ordering::Relaxed);
        let now = Instant::now();
        *state = State { phase, total, began: now, last_json: now };
        self.write_json(&mut state);
        if let Face::Bar(bar) = &self.face {
            bar.reset();
            bar.set_style(style(phase, total));
            bar.set_message(phase);
            bar.set_length(total);
            bar.enable_steady_tick(Duration::from_millis(200));
        }
    }

    /// `points` more are done.
    pub(crate) fn step(&self, points: u64) {
        self.done.fetch_add(points, Ordering::Relaxed);
        match &self.face {
            Face::Bar(bar) => bar.inc(points),
            // If the lock is taken, its holder writes the line.
            Face::Json => {
                if let Ok(mut state) = self.state.try_lock()
                    && state.last_json.elapsed() >= JSON_INTERVAL
                {
                    self.write_json(&mut state);
                }
            }
            Face::Silent => {}
        }
    }

    /// `done` of `total` points of a phase are done; for callers that count themselves, whose calls may overtake each other.
    pub(crate) fn at(&self, phase: &'static str, done: u64, total: u64) {
        let (same_phase, same_total) = {
            let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            (state.phase == phase, state.total == total)
        };
        if !same_phase {
            self.begin(phase, total);
        } else if !same_total {
            self.state.lock().unwrap_or_else(PoisonError::into_inner).total = total;
            if let Face::Bar(bar) = &self.face {
                bar.set_length(total);
            }
        }
        self.step(done.saturating_sub(self.done.load(Ordering::Relaxed)));
    }

    /// What is being done within the phase.
    pub(crate) fn detail(&self, what: &str) {
        if let Face::Bar(bar) = &self.face {
            bar.set_message(what.to_owned());
        }
    }

    /// Reports a warning.
    pub(crate) fn note(&self, line: &str) {
        if self.stopped() || self.quiet || self.warnings.fetch_add(1, Ordering::Relaxed) >= MAX_WARNINGS {
            return;
        }
        match &self.face {
            Face::Bar(bar) => bar.suspend(|| print_line(&format!("warning: {line}"))),
            Face::Json => write_line(&json!({ "warning": line })),
            Face::Silent => print_line(&format!("warning: {line}")),
        }
    }

    /// True once Ctrl-C was pressed.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// Clears the bar, so that other lines can follow; true if the result is to be printed as text.
    pub(crate) fn end(&self) -> bool {
        match &self.face {
            Face::Bar(bar) => bar.finish_and_clear(),
            Face::Json => self.write_json(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner)),
            Face::Silent => {}
        }
        let hidden = self.warnings.load(Ordering::Relaxed).saturating_sub(MAX_WARNINGS);
        let for_people = !self.quiet && !matches!(self.face, Face::Json);
        if for_people && hidden > 0 {
            print_line(&format!("warning: {hidden} more warnings; see the report"));
        }
        for_people
    }

    fn write_json(&self, state: &mut State) {
        // a run that is to stop must not wait for a reader
        if !matches!(self.face, Face::Json) || self.stopped() {
            return;
        }
        state.last_json = Instant::now();
        let done = self.done.load(Ordering::Relaxed);
        let elapsed = state.began.elapsed().as_secs_f64();
        let per_second = if elapsed > 0.0 { done as f64 / elapsed } else { 0.0 };
        let left = (done > 0 && state.total > 0).then(|| state.total.saturating_sub(done) as f64 / per_second);
        write_line(&json!({
            "phase": state.phase,
            "done": done,
            "total": (state.total > 0).then_some(state.total),
            "points_per_second": (unit(state.phase) == "points").then(|| per_second.round()),
            "memory_bytes": pointmill_converter::memory::resident_bytes(),
            "eta_seconds": left.map(|s| (s * 10.0).round() / 10.0),
        }));
    }
}

impl Events for Progress {
    fn phase(&self, phase: Phase, total: u64) {
        self.begin(phase.name(), total);
        match &self.face {
            _ if phase != Phase::CleanUp => {}
            Face::Silent if !self.quiet => interrupt::tell_of_cleaning(interrupt::cleaning_line),
            Face::Json => interrupt::tell_of_cleaning(|| write_line(&json!({ "phase": Phase::CleanUp.name() }))),
            _ => {}
        }
    }

    fn advance(&self, points: u64) {
        self.step(points);
    }

    fn warning(&self, warning: &Warning) {
        self.note(&flags::warning_line(warning));
    }

    fn works_in(&self, folder: &Path) {
        interrupt::works_in(folder);
    }

    fn checkpoint(&self, folder: Option<&Path>) {
        interrupt::keeps(folder.map(|folder| {
            format!("interrupted; what was read is safe in {}, and --resume goes on there", folder.display())
        }));
    }

    fn settling(&self) {
        interrupt::settling();
    }

    fn stop_requested(&self) -> bool {
        self.stopped()
    }
}

fn write_line(object: &serde_json::Value) {
    // Nothing can be reported when standard error is closed.
    let _ = writeln!(io::stderr().lock(), "{}", json_escaped(&object.to_string()));
}

/// The phase of a command that runs conversions.
pub(crate) const MEASURE: &str = "measure";

/// What is counted in a phase.
fn unit(phase: &str) -> &'static str {
    match phase {
        MEASURE => "settings",
        _ if phase == Phase::Probe.name() => "scans",
        _ => "points",
    }
}

fn style(phase: &str, total: u64) -> ProgressStyle {
    let unit = unit(phase);
    let template = match total {
        0 => "{msg:8} {spinner} {elapsed}",
        _ if unit != "points" => "{msg:8} [{bar:30}] {percent:>3} %  {points}  {left}",
        _ => "{msg:8} [{bar:30}] {percent:>3} %  {points}  {speed}  {left}  {memory}",
    };
    let per_second = |state: &ProgressState| state.pos() as f64 / state.elapsed().as_secs_f64().max(1e-3);
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .progress_chars("=> ")
        .with_key("points", move |state: &ProgressState, w: &mut dyn std::fmt::Write| {
            let _ = write!(w, "{} of {} {unit}", count(state.pos()), count(state.len().unwrap_or(0)));
        })
        .with_key("speed", move |state: &ProgressState, w: &mut dyn std::fmt::Write| {
            let _ = write!(w, "{}", rate(per_second(state)));
        })
        .with_key("memory", move |_: &ProgressState, w: &mut dyn std::fmt::Write| {
            if let Some(now) = pointmill_converter::memory::resident_bytes() {
                let _ = write!(w, "{}", bytes(now));
            }
        })
        .with_key("left", move |state: &ProgressState, w: &mut dyn std::fmt::Write| {
            let left = state.len().unwrap_or(0).saturating_sub(state.pos());
            if state.pos() > 0 {
                let _ = write!(w, "{} left", seconds(left as f64 / per_second(state)));
            }
        })
}
