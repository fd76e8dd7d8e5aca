//! Reads `index.json` from front to back, in either form.

use super::json::{Fault, Json};
use super::node::{INDEX_FILE, MAX_DEPTH};
use super::preorder::Preorder;
use super::read_header::{HeaderText, known_key};
use super::{Header, Layout, Node, NodeKind};
use crate::bytes::ByteSource;
use crate::{Aabb, ReadError};

/// The header and all nodes in preorder. Memory: that of the nodes; the text is not kept.
/// More than `most_nodes` are not read.
pub(super) fn read_index(source: &dyn ByteSource, most_nodes: usize) -> Result<(Header, Vec<Node>), ReadError> {
    parse(source, most_nodes).map_err(|fault| {
        let path = source.locate(INDEX_FILE);
        let advice = "convert the sources again, or copy the folder again if it was whole elsewhere";
        match fault {
            Fault::Broken(at, what) => ReadError::broken(path, at, what).advise(advice),
            Fault::Unsupported(at, what) => ReadError::unsupported(path, what).at(at),
            Fault::Memory(at) => {
                ReadError::memory(path, format!("has more than {most_nodes} nodes, the most that fit memory")).at(at)
            }
            Fault::Io(e) => ReadError::io(path, "reading", e)
                .advise("a binary tree is a folder with index.json and leaves.bin or one file per leaf"),
        }
    })
}

fn parse(source: &dyn ByteSource, most_nodes: usize) -> Result<(Header, Vec<Node>), Fault> {
    let mut json = Json::new(source, INDEX_FILE)?;
    let (mut header, mut nodes) = (HeaderText::default(), None);
    json.expect(b'{')?;
    let mut first = true;
    while let Some(key) = json.key(first)? {
        first = false;
        match key {
            "nodes" | "root" if nodes.is_some() => return json.broken("the nodes stand there twice"),
            "nodes" => nodes = Some(flat_nodes(&mut json, most_nodes)?),
            "root" => nodes = Some(nested_nodes(&mut json, most_nodes)?),
            key => match known_key(key) {
                Some(key) => header.take(key, &mut json)?,
                None => json.skip()?,
            },
        }
    }
    json.end()?;
    let at = header.place("points");
    let layout_at = header.place("layout");
    let header = header.parse()?;
    let tree = nodes.unwrap_or_default();
    let found = tree.nodes.first().map_or(0, |root| root.count);
    if found != header.points {
        return Err(Fault::Broken(at, format!("points is {}, the nodes have {found}", header.points)));
    }
    let (absent, present) = match header.layout {
        Layout::Files => ("file", "start"),
        Layout::Packed => ("start", "file"),
    };
    if tree.has(present) {
        let what = format!("the layout is {}, but a leaf has a {present} instead of a {absent}", header.layout.name());
        return Err(Fault::Broken(layout_at, what));
    }
    Ok((header, tree.nodes))
}

/// A node object, key by key.
#[derive(Default)]
struct NodeText {
    min: Option<[f64; 3]>,
    max: Option<[f64; 3]>,
    count: Option<u64>,
    /// −1 for degenerate.
    axis: Option<i8>,
    split: Option<f64>,
    degenerate: Option<bool>,
    children: Option<[u32; 2]>,
    center: Option<[f64; 3]>,
    file: Option<Box<str>>,
    start: Option<u64>,
    /// Byte of its brace.
    at: u64,
}

/// The keys of a node; others are skipped.
const KEYS: [&str; 10] = ["min", "max", "count", "axis", "split", "degenerate", "children", "center", "file", "start"];

/// The key as one of ours, or nothing.
fn node_key(key: &str) -> &'static str {
    KEYS.into_iter().find(|k| *k == key).unwrap_or_default()
}

impl NodeText {
    /// Takes the value of `key`, which comes next; `children` are numbers.
    fn take(&mut self, key: &str, json: &mut Json) -> Result<(), Fault> {
        let twice = match key {
            "min" => self.min.replace(json.vector()?).is_some(),
            "max" => self.max.replace(json.vector()?).is_some(),
            "count" => self.count.replace(json.whole()?).is_some(),
            "axis" => self.axis.replace(axis(json)?).is_some(),
            "split" => self.split.replace(json.double()?).is_some(),
            "degenerate" => self.degenerate.replace(json.boolean()?).is_some(),
            "center" => self.center.replace(json.vector()?).is_some(),
            "file" => self.file.replace(json.string()?.into()).is_some(),
            "start" => self.start.replace(json.whole()?).is_some(),
            "children" => self.children.replace(children(json)?).is_some(),
            _ => return json.skip(),
        };
        if twice { json.broken(format!("the key {key} stands twice in a node")) } else { Ok(()) }
    }

    /// The node, and the file that it names. The error continues "node 7 …".
    fn finish(self) -> Result<(Node, Option<Box<str>>), String> {
        let missing = |key: &str| format!("has no {key}");
        let min = self.min.ok_or_else(|| missing("min"))?;
        let max = self.max.ok_or_else(|| missing("max"))?;
        let count = self.count.ok_or_else(|| missing("count"))?;
        let kind = match self.children {
            Some(_) if self.file.is_some() || self.start.is_some() => return Err("has children and points".into()),
            Some(_) if self.degenerate == Some(true) && self.axis.is_some_and(|axis| axis >= 0) => {
                return Err("is degenerate, but has an axis".into());
            }
            Some([_, high]) if self.degenerate == Some(true) => NodeKind::Degenerate { high },
            Some([_, high]) => {
                let axis = u8::try_from(self.axis.ok_or_else(|| missing("axis"))?);
                let axis = axis.map_err(|_| "has axis -1, but is not degenerate")?;
                NodeKind::Inner { axis, split: self.split.ok_or_else(|| missing("split"))?, high }
            }
            None if self.file.is_some() == self.start.is_some() => {
                return Err("has to have children, or either a file or a start".into());
            }
            None => NodeKind::Leaf { center: self.center.ok_or_else(|| missing("center"))?, start: self.start },
        };
        Ok((Node { bounds: Aabb { min, max }, count, kind }, self.file))
    }
}

fn axis(json: &mut Json) -> Result<i8, Fault> {
    let value = json.double()?;
    if [-1.0, 0.0, 1.0, 2.0].contains(&value) { Ok(value as i8) } else { json.broken("axis has to be 0, 1, 2 or -1") }
}

fn children(json: &mut Json) -> Result<[u32; 2], Fault> {
    let index = |json: &mut Json| {
        let index = u32::try_from(json.whole()?).ok();
        index.map_or_else(|| json.broken("a child has an index above 32 bits"), Ok)
    };
    json.expect(b'[')?;
    let low = index(json)?;
    json.expect(b',')?;
    let high = index(json)?;
    json.expect(b']')?;
    Ok([low, high])
}

/// Nodes as they come, checked one by one.
#[derive(Default)]
struct Tree {
    nodes: Vec<Node>,
    order: Preorder,
    has_file: bool,
    has_start: bool,
}

impl Tree {
    fn push(&mut self, text: NodeText) -> Result<(), Fault> {
        let (at, low) = (text.at, text.children.map(|[low, _]| low));
        let index = self.order.len();
        let pushed = text.finish().and_then(|(node, file)| {
            self.has_start |= matches!(node.kind, NodeKind::Leaf { start: Some(_), .. });
            if let Some(file) = file {
                self.has_file = true;
                let expected = self.order.file_name();
                if *file != *expected {
                    return Err(format!("is in the file {:?}, its place in the tree has the name {expected}", &*file));
                }
            }
            if low.is_some_and(|low| low != index + 1) {
                return Err(format!("has the low child {}, in preorder it is {}", low.unwrap_or(0), index + 1));
            }
            self.order.push(&node, None)?;
            self.nodes.push(node);
            Ok(())
        });
        pushed.map_err(|what| Fault::Broken(at, format!("node {index} {what}")))
    }

    fn has(&self, key: &str) -> bool {
        if key == "file" { self.has_file } else { self.has_start }
    }

    fn finish(self, at: u64) -> Result<Self, Fault> {
        self.order.finish().map_err(|what| Fault::Broken(at, what))?;
        Ok(self)
    }
}

/// The array of the key `nodes`.
fn flat_nodes(json: &mut Json, most: usize) -> Result<Tree, Fault> {
    let mut tree = Tree::default();
    json.expect(b'[')?;
    while json.another(b']', tree.order.len() == 0)? {
        json.peek()?;
        let mut text = NodeText { at: json.position(), ..NodeText::default() };
        json.expect(b'{')?;
        let mut first = true;
        while let Some(key) = json.key(first)? {
            first = false;
            let key = node_key(key);
            text.take(key, json)?;
        }
        if tree.nodes.len() == most {
            return Err(Fault::Memory(text.at));
        }
        tree.push(text)?;
    }
    tree.finish(json.position())
}

/// A node of the nested form that has begun and not ended.
struct Open {
    text: NodeText,
    index: u32,
    /// No key was taken.
    first: bool,
    /// Between the brackets of its children, how many of them have begun.
    children_begun: Option<u8>,
}

/// The node of the key `root` and all below. The path to the current node is a stack of ours, not of the machine.
fn nested_nodes(json: &mut Json, most: usize) -> Result<Tree, Fault> {
    // Keys of a node may stand behind its children, so that nodes are complete in another order than they begin.
    let mut texts: Vec<NodeText> = Vec::new();
    let mut path: Vec<Open> = Vec::new();
    if json.null()? {
        return Ok(Tree::default());
    }
    open(json, &mut texts, &mut path, most)?;
    while let Some(node) = path.last_mut() {
        if let Some(begun) = node.children_begun {
            if !json.another(b']', begun == 0)? {
                node.children_begun = None;
                if begun != 2 {
                    return json.broken(format!("a node has {begun} children, it has to have 2"));
                }
                continue;
            }
            let index = u32::try_from(texts.len()).or_else(|_| json.broken("there are more nodes than 2^32"))?;
            match (begun, &mut node.text.children) {
                (0, children) if children.is_none() => *children = Some([index, 0]),
                (1, Some([_, high])) => *high = index,
                _ => return json.broken("a node has more than 2 children"),
            }
            node.children_begun = Some(begun + 1);
            open(json, &mut texts, &mut path, most)?;
            continue;
        }
        match json.key(node.first)? {
            Some("children") => {
                json.expect(b'[')?;
                node.children_begun = Some(0);
            }
            Some(key) => {
                let key = node_key(key);
                node.text.take(key, json)?;
            }
            None => {
                if let Some(Open { text, index, .. }) = path.pop() {
                    texts[index as usize] = text;
                }
                continue;
            }
        }
        node.first = false;
    }
    let mut tree = Tree::default();
    texts.into_iter().try_for_each(|text| tree.push(text))?;
    tree.finish(json.position())
}

fn open(json: &mut Json, texts: &mut Vec<NodeText>, path: &mut Vec<Open>, most: usize) -> Result<(), Fault> {
    json.peek()?;
    // the texts of nested nodes are kept beside the nodes that they become
    if texts.len() >= most.div_ceil(3) {
        return Err(Fault::Memory(json.position()));
    }
    if path.len() > MAX_DEPTH {
        return json.broken(format!("nodes are nested more than {MAX_DEPTH} deep"));
    }
    let text = NodeText { at: json.position(), ..NodeText::default() };
    json.expect(b'{')?;
    path.push(Open { text, index: texts.len() as u32, first: true, children_begun: None });
    texts.push(NodeText::default());
    Ok(())
}
