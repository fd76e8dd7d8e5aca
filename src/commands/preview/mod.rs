//! `pointmill preview`: pictures of a dataset or of scans.

mod output;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use pointmill_format::Located;
use pointmill_render::{Camera, Flight, Picture, Scene};
use serde_json::{Value, json};

use crate::args::PreviewArgs;
use crate::datasets;
use crate::exit::{Failure, emit, print_line, to_json};
use crate::human::quantities::{bytes, plural, seconds};
use output::Output;

/// A path of cameras is smaller.
const MAX_PATH_BYTES: u64 = 64 << 20;

pub(crate) fn run(args: &PreviewArgs) -> Result<(), Failure> {
    args.inputs.reading.placing.refuse_idle_crs()?;
    let flight = args.path.as_deref().map(read_flight).transpose()?;
    let frames = flight.as_ref().and(args.frames);
    let output = Output::new(&args.output, frames, args.overwrite)?;
    if let (Some(flight), Some(path)) = (&flight, &args.path) {
        check_frames(flight, frames.unwrap_or(1), path)?;
    }
    let begin = Instant::now();
    let scene = open(args, &output)?;
    check_style(args, &scene)?;
    if !args.quiet {
        scene.warnings().iter().for_each(|line| print_line(line));
    }
    let cameras: Vec<Camera> = match (&flight, &args.camera) {
        (Some(flight), _) => flight.frames(frames.unwrap_or(1)).collect(),
        (None, Some(camera)) => vec![*camera],
        (None, None) => vec![scene.view(args.view, args.size)],
    };
    let style = args.style();
    let opened = begin.elapsed().as_secs_f64();
    let mut objects = Vec::new();
    for (camera, file) in cameras.iter().zip(output.files()) {
        let begin = Instant::now();
        let threads = args.threads.map_or(0, |n| n.get().into());
        let picture = scene.render(camera, args.size, &style, args.budget, threads)?;
        let rendered = begin.elapsed().as_secs_f64();
        output.write(&file, &picture.png()?)?;
        let times = Times { opened, rendered, written: begin.elapsed().as_secs_f64() - rendered };
        if !args.quiet {
            tell(&file, &scene, &picture, &times);
        }
        if args.json {
            objects.push(object(&file, &scene, camera, &picture, &times));
        }
    }
    if !args.json {
        return Ok(());
    }
    // of a flight there is an array
    let whole = if frames.is_some() { Value::Array(objects) } else { objects.pop().unwrap_or_default() };
    emit(&to_json(&whole)?)
}

/// A dataset as it is, or scans as one cloud. A dataset whose points are to be moved is read as a scan.
fn open(args: &PreviewArgs, output: &Output) -> Result<Scene, Failure> {
    if let Some(dataset) = dataset(args)? {
        output.protect(&[dataset.marker_path()])?;
        return Ok(Scene::of_dataset(&dataset)?);
    }
    let found = args.inputs.expand(&args.output)?;
    if let Some(failure) = found.unread_failure("") {
        return Err(failure);
    }
    if !args.quiet {
        found.all_notes().for_each(|note| print_line(&note));
    }
    output.protect(&found.files)?;
    let threads = args.threads.map_or(0, |n| n.get().into());
    Ok(Scene::of_scans(&found.files, args.inputs.options()?, threads)?)
}

/// The dataset, if that is what is named.
fn dataset(args: &PreviewArgs) -> Result<Option<Located>, Failure> {
    let ([input], None) = (&args.inputs.inputs[..], args.inputs.reading.given()) else { return Ok(None) };
    if args.inputs.files_from.is_some() {
        return Ok(None);
    }
    datasets::named(input)
}

fn read_flight(file: &Path) -> Result<Flight, Failure> {
    let io = |e| Failure::io(file, "reading the path of the camera", &e);
    let meta = fs::metadata(file).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Failure::Usage(format!("{}: no such file", file.display())),
        _ => io(e),
    })?;
    if !meta.is_file() || meta.len() > MAX_PATH_BYTES {
        return Err(Failure::Usage(format!("{}: not a file with a path of a camera", file.display())));
    }
    let text = fs::read(file).map_err(io)?;
    Flight::from_json(&text).map_err(|e| Failure::Input(format!("{}: {e}", file.display())))
}

/// Keyframes are cameras; what lies between two of them need not be one. No picture is made of a flight that cannot be flown.
fn check_frames(flight: &Flight, frames: u32, file: &Path) -> Result<(), Failure> {
    for (number, camera) in (1..).zip(flight.frames(frames)) {
        camera.axes().map_err(|e| Failure::Input(format!("{}: picture {number} of {frames}: {e}", file.display())))?;
    }
    Ok(())
}

/// Refuses what the format has not.
fn check_style(args: &PreviewArgs, scene: &Scene) -> Result<(), Failure> {
    let idle = [("--clod", args.clod.is_some()), ("--bits", args.bits.is_some())];
    match idle.into_iter().find(|(_, is_given)| *is_given && !scene.is_batches()) {
        Some((option, _)) => {
            Err(Failure::Usage(format!("{option} is for quantised batches; this is {}: leave it out", scene.format())))
        }
        None => Ok(()),
    }
}

struct Times {
    opened: f64,
    rendered: f64,
    written: f64,
}

/// The line for people, and what they may not expect.
fn tell(file: &Path, scene: &Scene, picture: &Picture, times: &Times) {
    let drawn = picture.drawn;
    let shown = file.display();
    if drawn.points == 0 {
        print_line(&format!("{shown}: there are no points in sight; the picture is empty"));
    } else if picture.covered() == 0 {
        print_line(&format!("{shown}: no point is in the picture; it is empty"));
    }
    let nodes = plural(drawn.nodes, if scene.is_scans() { "piece" } else { "node" });
    let (points, read) = (plural(drawn.points, "point"), bytes(drawn.bytes));
    let (format, colour) = (scene.format(), drawn.colour.name());
    let time = seconds(times.opened + times.rendered + times.written);
    print_line(&format!("{shown}: {format}, {points} of {nodes}, {read} read, coloured by {colour}, {time}"));
}

fn object(file: &Path, scene: &Scene, camera: &Camera, picture: &Picture, times: &Times) -> Value {
    let drawn = picture.drawn;
    json!({
        "output": PathBuf::from(file).to_string_lossy(),
        "format": scene.format(),
        "width": picture.width,
        "height": picture.height,
        "camera": {
            "eye": camera.eye,
            "target": camera.target,
            "up": camera.up,
            "fov": camera.vertical_fov,
        },
        "colour": drawn.colour.name(),
        "nodes": drawn.nodes,
        "points": drawn.points,
        "bytes": drawn.bytes,
        "covered_pixels": picture.covered(),
        "seconds": { "open": times.opened, "render": times.rendered, "write": times.written },
    })
}
