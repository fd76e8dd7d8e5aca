//! A file of a job, taken apart, so that its parts can be changed and given their checksums again.

use pointmill_testkit::damage::{u32_at, u64_at};

const MAGIC: usize = 16;
/// Before a payload of a journal; behind the table of a unit; an entry of this table.
const HEAD: usize = 12;
const TAIL: usize = 28;
const ENTRY: usize = 20;

/// A file of a job. Parts have checksums in it.
#[derive(Clone)]
pub(crate) enum JobFile {
    /// What has none, or none that a forger would need.
    Plain(Vec<u8>),
    Journal(Vec<Vec<u8>>),
    Unit {
        sections: Vec<Vec<u8>>,
        label: [u8; 4],
    },
}

impl JobFile {
    pub(crate) fn of(bytes: Vec<u8>) -> Self {
        if bytes.starts_with(b"pointmill job 1\n") {
            let (mut rest, mut payloads) = (&bytes[MAGIC..], Vec::new());
            while !rest.is_empty() {
                let (payload, others) = rest[HEAD..].split_at(u32_at(rest, 0) as usize);
                payloads.push(payload.to_vec());
                rest = others;
            }
            return Self::Journal(payloads);
        }
        if !bytes.starts_with(b"pointmill unit 1") {
            return Self::Plain(bytes);
        }
        let tail = bytes.len() - TAIL;
        let table = &bytes[tail - u32_at(&bytes, tail) as usize..tail];
        let section = |entry: &[u8]| {
            let [start, length] = [0, 8].map(|at| u64_at(entry, at) as usize);
            bytes[start..start + length].to_vec()
        };
        let label = bytes[tail + 8..tail + 12].try_into().unwrap();
        Self::Unit { sections: table.chunks(ENTRY).map(section).collect(), label }
    }

    pub(crate) fn parts(&self) -> &[Vec<u8>] {
        match self {
            Self::Plain(_) => &[],
            Self::Journal(parts) | Self::Unit { sections: parts, .. } => parts,
        }
    }

    pub(crate) fn parts_mut(&mut self) -> &mut [Vec<u8>] {
        match self {
            Self::Plain(_) => &mut [],
            Self::Journal(parts) | Self::Unit { sections: parts, .. } => parts,
        }
    }

    /// The file, with the right lengths and checksums.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let sum = |bytes: &[u8]| crc32c::crc32c(bytes).to_le_bytes();
        match self {
            Self::Plain(bytes) => bytes.clone(),
            Self::Journal(payloads) => {
                let mut file = b"pointmill job 1\n".to_vec();
                for payload in payloads {
                    let head = [(payload.len() as u32).to_le_bytes(), sum(payload)].concat();
                    file.extend([&head[..], &sum(&head), payload].concat());
                }
                file
            }
            Self::Unit { sections, label } => {
                let (mut file, mut table) = (b"pointmill unit 1".to_vec(), Vec::new());
                for section in sections {
                    table.extend([file.len() as u64, section.len() as u64].map(u64::to_le_bytes).concat());
                    table.extend(sum(section));
                    file.extend(section);
                }
                let tail = [&(table.len() as u32).to_le_bytes()[..], &sum(&table), label, b"pointmill unit 1"].concat();
                [file, table, tail].concat()
            }
        }
    }
}
