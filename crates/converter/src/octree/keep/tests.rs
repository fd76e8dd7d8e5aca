use super::*;
use crate::error::JobFault;
use crate::runtime::{Disk, Pool, SystemDisk, TempFiles};

const UNIT: NodeKey = NodeKey { level: 1, x: 1, y: 0, z: 0 };
const OF: Of = Of { key: UNIT, streams: 1 };
const STRIDE: usize = 4;

fn child(key: NodeKey, index: u8) -> NodeKey {
    key.child(index).unwrap()
}

fn node(key: NodeKey, points: u32, byte_offset: u64, byte_size: u64) -> FinishedNode {
    FinishedNode { key, points, byte_offset, byte_size }
}

fn written(points: usize) -> Checksum {
    let mut sum = Checksum::default();
    sum.add_all(&vec![7; points * STRIDE], STRIDE);
    sum
}

fn pending_node(key: NodeKey, points: u64) -> KeptNode {
    KeptNode { key, points, is_one_place: false, is_inner: true }
}

type Lie = fn(&mut Kept);

/// A unit with two finished nodes, and with three that are pending.
fn unit() -> Kept {
    let nodes = vec![node(child(UNIT, 0), 5, 0, 20), node(child(UNIT, 1), 2, 20, 10)];
    let root = [(UNIT, 3), (child(UNIT, 4), 1), (child(child(UNIT, 4), 7), 2)];
    Kept {
        is_in_place: false,
        pieces: vec![KeptPiece::Nodes(vec![nodes])],
        root: root.map(|(key, points)| pending_node(key, points)).into(),
        ledger: Ledger::default(),
        written: vec![written(7)],
        overfull_leaves: 0,
        notes: vec![Vec::new()],
    }
}

fn nodes(unit: &mut Kept) -> &mut Vec<FinishedNode> {
    let Some(KeptPiece::Nodes(runs)) = unit.pieces.first_mut() else { panic!("it has nodes") };
    &mut runs[0]
}

#[test]
fn a_unit_whose_numbers_cannot_be_is_not_taken() {
    let can_be = |unit: &Kept| unit.can_be_of(OF, STRIDE as u64, |_, _| Some(30));
    assert!(can_be(&unit()));
    let lies: [(&str, Lie); 12] = [
        ("bytes between nodes", |unit| nodes(unit)[1].byte_offset += 1),
        ("more bytes than there are", |unit| nodes(unit)[1].byte_size += 1),
        ("bytes without end", |unit| nodes(unit)[1].byte_size = u64::MAX),
        ("other points", |unit| nodes(unit)[0].points += 1),
        ("no points", |unit| nodes(unit)[0].points = 0),
        ("a node elsewhere", |unit| nodes(unit)[0].key = child(NodeKey::ROOT, 0)),
        ("a level that is none", |unit| nodes(unit)[0].key.level = 200),
        ("a place that is none", |unit| nodes(unit)[0].key.x = 1 << 20),
        ("another root", |unit| unit.root[0].key = child(UNIT, 0)),
        ("no root", |unit| unit.root.clear()),
        ("a stream too many", |unit| unit.written.push(written(1))),
        ("a node of all points that there can be", |unit| {
            unit.pieces.push(KeptPiece::Large { key: UNIT, points: u64::MAX, is_one_place: false });
        }),
    ];
    for (what, lie) in lies {
        let mut unit = unit();
        lie(&mut unit);
        assert!(!can_be(&unit), "{what}");
    }
}

#[test]
fn pending_nodes_come_back_and_those_that_are_no_tree_are_not_taken() {
    let dir = tempfile::tempdir().unwrap();
    let disk: Arc<dyn Disk> = Arc::new(SystemDisk);
    let lists = Lists::new(
        STRIDE,
        &Arc::new(Pool::new(1 << 20, 1 << 20)),
        &TempFiles::new(dir.path().into(), Arc::clone(&disk)),
    );
    let path = dir.path().join("unit");
    let read = |root: Vec<KeptNode>, points: usize| {
        let mut file = UnitWriter::create(&path, 0, &disk).unwrap();
        file.put(&Kept { root, ..unit() }).unwrap();
        file.put(&Outer::new()).unwrap();
        for bytes in [points * STRIDE, 30] {
            file.begin();
            file.write(&vec![1; bytes]).unwrap();
        }
        file.finish(false).unwrap();
        let length = std::fs::metadata(&path).unwrap().len();
        let file = UnitReader::open(&path, 0, DiskFile::open(&path, path.clone(), &disk).unwrap(), length).unwrap();
        read_root(&file, OF, &lists)
    };
    let root = read(unit().root, 6).unwrap().unwrap();
    assert_eq!((root.key, root.points.count(), root.children.len()), (UNIT, 3, 1));
    let [child_of_root] = &root.children[..] else { panic!("one child") };
    assert_eq!((child_of_root.points.count(), child_of_root.children[0].points.count()), (1, 2));
    let is_damaged = |root: Vec<KeptNode>, points: usize| {
        matches!(read(root, points), Err(ConvertError::Job(JobFault::Damaged { .. })))
    };
    assert!(is_damaged(unit().root, 7), "records of no node");
    let with = |key: NodeKey, points: u64| [unit().root, vec![pending_node(key, points)]].concat();
    assert!(is_damaged(with(child(NodeKey::ROOT, 0), 0), 6), "a node of no parent");
    assert!(is_damaged(with(child(UNIT, 5), u64::MAX), 6), "more records than there can be");
    // one in the other, as deep as a file is long
    assert!(is_damaged((0..100_000).map(|_| pending_node(UNIT, 0)).collect(), 0));
}
