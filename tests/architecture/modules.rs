//! The modules of a crate: in which file each lives, what it imports, and which paths its code names.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::tokens::{Token, text, tokens};

/// A path in an import or in code.
#[derive(Debug, Clone)]
pub(crate) struct Named {
    pub(crate) segments: Vec<String>,
    pub(crate) line: usize,
}

/// One name of a `use`.
#[derive(Debug, Clone)]
pub(crate) struct Import {
    pub(crate) path: Named,
    /// What the name is here; `*` for all names.
    pub(crate) alias: String,
    /// `pub use`, `pub(crate) use`, …
    pub(crate) public: bool,
}

#[derive(Debug, Default)]
pub(crate) struct Module {
    pub(crate) file: usize,
    pub(crate) parent: Option<usize>,
    pub(crate) children: BTreeMap<String, usize>,
    pub(crate) imports: Vec<Import>,
    /// Paths outside imports.
    pub(crate) paths: Vec<Named>,
    /// Names of items that are defined here.
    pub(crate) items: BTreeSet<String>,
}

#[derive(Debug)]
pub(crate) struct File {
    pub(crate) path: PathBuf,
    /// Identifiers outside imports.
    pub(crate) words: BTreeSet<String>,
}

/// All modules of a crate; the first is its root.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    pub(crate) modules: Vec<Module>,
    pub(crate) files: Vec<File>,
    /// The file of each macro.
    pub(crate) macros: BTreeMap<String, usize>,
}

impl Tree {
    /// Reads the crate whose root file is `root`.
    pub(crate) fn read(root: &Path) -> Self {
        let mut tree = Self::default();
        tree.load(root, None, root.parent().unwrap());
        tree
    }

    /// Loads a file as a module, and the files of its children, which are in `folder`.
    fn load(&mut self, file: &Path, parent: Option<usize>, folder: &Path) -> usize {
        let source = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let module = self.modules.len();
        let number = self.files.len();
        self.files.push(File { path: file.to_path_buf(), words: BTreeSet::new() });
        self.modules.push(Module { file: number, parent, ..Module::default() });
        Reader { tree: self, tokens: &tokens(&source), open: vec![(module, folder.to_path_buf(), 0)], depth: 0 }.read();
        module
    }

    fn load_child(&mut self, name: &str, parent: usize, folder: &Path) -> usize {
        let (flat, nested) = (folder.join(name).with_extension("rs"), folder.join(name).join("mod.rs"));
        let file = if flat.is_file() { flat } else { nested };
        self.load(&file, Some(parent), &folder.join(name))
    }
}

/// Reads the tokens of one file.
struct Reader<'a> {
    tree: &'a mut Tree,
    tokens: &'a [Token],
    /// Modules around the current token, each with the folder of its children and its depth in braces.
    open: Vec<(usize, PathBuf, usize)>,
    depth: usize,
}

impl Reader<'_> {
    fn read(mut self) {
        let mut i = 0;
        while i < self.tokens.len() {
            i = self.step(i);
        }
    }

    fn text(&self, i: usize) -> &str {
        text(self.tokens, i)
    }

    fn before(&self, i: usize, back: usize) -> &str {
        i.checked_sub(back).map_or("", |i| self.text(i))
    }

    fn module(&mut self) -> &mut Module {
        let module = self.open.last().unwrap().0;
        &mut self.tree.modules[module]
    }

    /// Reads from token `i`; returns where to go on.
    fn step(&mut self, i: usize) -> usize {
        let word = self.text(i).to_owned();
        match word.as_str() {
            "{" => self.depth += 1,
            "}" => {
                self.depth = self.depth.saturating_sub(1);
                if self.open.len() > 1 && self.open.last().unwrap().2 == self.depth {
                    self.open.pop();
                }
            }
            "mod" if [";", "{"].contains(&self.text(i + 2)) => return self.child(i),
            "use" if self.text(i + 1) != "<" => return self.import(i),
            "macro_rules" if self.text(i + 1) == "!" => {
                let (name, file) = (self.text(i + 2).to_owned(), self.module().file);
                self.tree.macros.insert(name, file);
            }
            "struct" | "enum" | "fn" | "trait" | "type" | "const" | "static" | "union" => {
                let name = self.text(i + 1).to_owned();
                self.module().items.insert(name);
            }
            _ if word.starts_with(|c: char| c.is_alphabetic() || c == '_') => return self.path(i),
            _ => {}
        }
        i + 1
    }

    /// `mod name;` or `mod name {`.
    fn child(&mut self, i: usize) -> usize {
        let name = self.text(i + 1).to_owned();
        let (parent, folder, _) = self.open.last().unwrap().clone();
        let child = if self.text(i + 2) == ";" {
            self.tree.load_child(&name, parent, &folder)
        } else {
            let file = self.tree.modules[parent].file;
            self.tree.modules.push(Module { file, parent: Some(parent), ..Module::default() });
            let child = self.tree.modules.len() - 1;
            self.open.push((child, folder.join(&name), self.depth));
            self.depth += 1;
            child
        };
        self.tree.modules[parent].children.insert(name, child);
        i + 3
    }

    fn import(&mut self, i: usize) -> usize {
        let public = ["pub", ")"].contains(&self.before(i, 1));
        let mut names = Vec::new();
        let end = use_tree(self.tokens, i + 1, &[], &mut names);
        let imports = names.into_iter().map(|(path, alias)| Import { path, alias, public });
        self.module().imports.extend(imports);
        end
    }

    fn path(&mut self, i: usize) -> usize {
        let (mut segments, mut next) = (vec![self.text(i).to_owned()], i + 1);
        while self.text(next) == "::" && self.text(next + 1).starts_with(|c: char| c.is_alphabetic() || c == '_') {
            segments.push(self.text(next + 1).to_owned());
            next += 2;
        }
        let file = self.module().file;
        self.tree.files[file].words.extend(segments.iter().cloned());
        // `pub(in crate::a)` needs nothing of it; `<T as X>::y` and `x.y` begin elsewhere
        let is_visibility = self.before(i, 1) == "in" && self.before(i, 3) == "pub";
        if segments.len() > 1 && !is_visibility && ![".", "::"].contains(&self.before(i, 1)) {
            let line = self.tokens[i].line;
            self.module().paths.push(Named { segments, line });
        }
        next
    }
}

/// Reads `a::{b, c::*, d as e}` from token `i`; returns where it ends.
fn use_tree(tokens: &[Token], mut i: usize, prefix: &[String], out: &mut Vec<(Named, String)>) -> usize {
    let mut segments = prefix.to_vec();
    let line = tokens.get(i).map_or(0, |token| token.line);
    loop {
        match text(tokens, i) {
            "{" => {
                i += 1;
                while !["}", ""].contains(&text(tokens, i)) {
                    i = use_tree(tokens, i, &segments, out);
                    i += usize::from(text(tokens, i) == ",");
                }
                return i + 1;
            }
            "*" => {
                out.push((Named { segments, line }, "*".to_owned()));
                return i + 1;
            }
            "::" => i += 1,
            "as" => {
                let alias = text(tokens, i + 1).to_owned();
                out.push((Named { segments, line }, alias));
                return i + 2;
            }
            "," | ";" | "}" | "" => {
                let alias = segments.last().cloned().unwrap_or_default();
                out.push((Named { segments, line }, alias));
                return i;
            }
            // `a::{self}` is `a`
            "self" if !segments.is_empty() => i += 1,
            word => {
                segments.push(word.to_owned());
                i += 1;
            }
        }
    }
}

#[test]
fn nested_imports_are_resolved() {
    let source = "use crate::{a::{B, C as D}, e::{self, f::*}, g};";
    let mut names = Vec::new();
    use_tree(&tokens(source), 1, &[], &mut names);
    let names: Vec<String> = names.iter().map(|(n, alias)| format!("{} {alias}", n.segments.join("::"))).collect();
    assert_eq!(names, ["crate::a::B B", "crate::a::C D", "crate::e e", "crate::e::f *", "crate::g g"]);
}
