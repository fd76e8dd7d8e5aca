//! Serves datasets with a page whose files are read from a folder for every request.
//!
//! ```text
//! cargo run -p pointmill-view --example serve -- --page crates/view/page --port 8080 DATASET...
//! ```

use pointmill_view::{Dataset, Event, Options, PageSource, Server};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut datasets, mut options) = (Vec::new(), Options::default());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--page" => {
                options = options.page(PageSource::Folder(arguments.next().ok_or("--page takes a folder")?.into()));
            }
            "--port" => options = options.port(arguments.next().ok_or("--port takes a number")?.parse()?),
            path => datasets.push(Dataset::open(path)?),
        }
    }
    let options = options.events(|event| match event {
        Event::Failed(line) => eprintln!("{line}"),
        other => eprintln!("{other:?}"),
    });
    let server = Server::bind(options)?;
    println!("{}", server.url());
    server.run(datasets, || false)?;
    Ok(())
}
