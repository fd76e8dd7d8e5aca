//! Memory that the host has lent before a run starts, so that no run waits for it.
//!
//! Hosts of virtual machines take back what is free for some seconds, and lend it again page by page when it is touched:
//! that costs the guest's kernel ten times as much as clearing the page. A second process holds memory that was touched,
//! and lets go of it while a measured program takes some: a little at a time, or the host would be faster. Between runs it
//! takes back what the last one freed.

use std::io::{self, BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use pointmill_bench::process::prefer_large_pages;

/// What is let go of at once.
const BLOCK: usize = 32 << 20;

/// What is free beyond what was free before.
const MARGIN: u64 = 128 << 20;

const POLL: Duration = Duration::from_millis(10);

/// The other process, seen from the one that measures.
pub(crate) struct Ballast {
    process: Child,
    /// Closed, it ends.
    orders: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Ballast {
    /// Starts the process: this program, with the option for it.
    ///
    /// # Errors
    /// Of the operating system.
    pub(crate) fn start() -> io::Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        let mut process = command.arg("--ballast").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let orders = process.stdin.take();
        let answers = process.stdout.take().ok_or_else(|| io::Error::other("no pipe"))?;
        Ok(Self { process, orders, answers: BufReader::new(answers) })
    }

    /// Waits until so much memory is held.
    ///
    /// # Errors
    /// The process is gone.
    pub(crate) fn fill(&mut self, bytes: u64) -> io::Result<()> {
        let orders = self.orders.as_mut().ok_or_else(|| io::Error::other("no pipe"))?;
        writeln!(orders, "{bytes}")?;
        let mut answer = String::new();
        match self.answers.read_line(&mut answer)? {
            0 => Err(io::Error::other("the process that holds memory has ended; try a smaller --lend")),
            _ => Ok(()),
        }
    }
}

impl Drop for Ballast {
    fn drop(&mut self) {
        drop(self.orders.take());
        let _ = self.process.wait();
    }
}

/// Holds as many bytes as each line of standard input says, answers with a line, and ends with the input.
pub(crate) fn hold() {
    let (orders, inbox) = mpsc::channel();
    std::thread::spawn(move || io::stdin().lines().map_while(Result::ok).try_for_each(|line| orders.send(line)));
    let mut blocks: Vec<Vec<u8>> = Vec::new();
    let mut wanted_free = 0;
    loop {
        match inbox.recv_timeout(POLL) {
            Ok(bytes) => {
                blocks.resize_with(bytes.parse().unwrap_or(0) / BLOCK, touched);
                wanted_free = free_bytes().unwrap_or(0) + MARGIN;
                release(&mut blocks, wanted_free);
                println!("held");
            }
            Err(mpsc::RecvTimeoutError::Timeout) => release(&mut blocks, wanted_free),
            Err(mpsc::RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Lets go of blocks until so much is free.
fn release(blocks: &mut Vec<Vec<u8>>, wanted_free: u64) {
    let lacking = wanted_free.saturating_sub(free_bytes().unwrap_or(u64::MAX));
    blocks.truncate(blocks.len().saturating_sub(lacking.div_ceil(BLOCK as u64) as usize));
}

/// A block in large pages, as the measured programs take them, of which every page was written to.
fn touched() -> Vec<u8> {
    let mut block = vec![0u8; BLOCK];
    prefer_large_pages(&mut block);
    block.iter_mut().step_by(4096).for_each(|byte| *byte = 1);
    block
}

/// Memory that nobody uses, the page cache neither; `None` where the system does not say.
fn free_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemFree:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_let_go_of_only_where_memory_lacks() {
        let mut blocks = vec![touched(), touched()];
        assert!(blocks.iter().all(|block| block.len() == BLOCK && block.iter().step_by(4096).all(|byte| *byte == 1)));
        release(&mut blocks, 0);
        assert_eq!(blocks.len(), 2);
        if let Some(free) = free_bytes() {
            assert!(free > 0);
            release(&mut blocks, 1 << 60);
            assert_eq!(blocks.len(), 0);
        }
    }
}
