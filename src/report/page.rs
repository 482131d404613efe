//! A sweep as one page that needs nothing but itself: charts, tables and pictures in one HTML file.

use base64::Engine;

use super::chart::{Chart, Series};
use super::escape;
use super::sweep::{Input, Run, Sweep, log_slope};

/// What tells whose a page is.
pub(super) const MARK: &str = concat!("<meta name=\"generator\" content=\"", env!("CARGO_PKG_NAME"), "\">");

const TEMPLATE: &str = include_str!("page.html");

/// The page of `sweep`, complete HTML.
pub fn page(sweep: &Sweep) -> String {
    let svgs = |charts: Vec<Chart>| charts.iter().map(Chart::svg).collect::<String>();
    let values = [
        ("MARK", MARK.to_owned()),
        ("REFERENCE", escape(&sweep.reference)),
        ("NOISE", noise(sweep)),
        ("TIME_CHARTS", svgs(time_charts(sweep))),
        ("SPP_CHART", spp_chart(sweep).svg()),
        ("SLOPES", slopes(sweep)),
        ("EQUAL_TIME", equal_time(sweep)),
        ("CALIBRATION_CHARTS", svgs(calibration_charts(sweep))),
        ("CALIBRATION", calibration(sweep)),
        ("SCORES", scores(sweep)),
        ("LAYERS", layers(sweep)),
    ];
    filled(TEMPLATE, &values)
}

/// `template` with its places `{{NAME}}` filled. In one pass: names of files and runs, which values hold, may look like
/// places themselves.
fn filled(template: &str, values: &[(&str, String)]) -> String {
    let mut pieces = template.split("{{");
    let mut page = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (place, rest) = piece.split_once("}}").expect("the template closes its places");
        let value = values.iter().find(|(name, _)| *name == place);
        page += &value.expect("every place of the template has a value").1;
        page += rest;
    }
    page
}

/// What the reference's own noise does to the figures.
fn noise(sweep: &Sweep) -> String {
    let Some(noise) = sweep.reference_noise else {
        return "The reference's own noise is in every figure; how much that is, the file does not tell."
            .into();
    };
    let drowned = match sweep.drowned() {
        0 => String::new(),
        1 => {
            " One result is nearer to the reference than that: it has no point, and its run no slope.".into()
        }
        n => format!(
            " {n} results are nearer to the reference than that: they have no point, and their runs no slope."
        ),
    };
    format!(
        "The reference's own noise adds {noise:.6} to every relMSE of the last table; in charts, slopes and equal times it \
         is taken off.{drowned}"
    )
}

/// What [`Sweep::error`] is called.
fn error_name(sweep: &Sweep) -> &'static str {
    if sweep.reference_noise.is_some() { "relMSE less the reference's noise" } else { "relMSE" }
}

/// Error against seconds, one chart for each input, the Pareto front joined by a line.
pub fn time_charts(sweep: &Sweep) -> Vec<Chart> {
    sweep.inputs.iter().map(|input| time_chart(sweep, input)).collect()
}

fn time_chart(sweep: &Sweep, input: &Input) -> Chart {
    let front = input.pareto_front();
    let points = |wanted: bool| {
        let timed = input.runs.iter().zip(&front).filter(|(_, on_front)| **on_front == wanted);
        let point = |(run, _): (&Run, _)| Some((run.seconds?, sweep.error(&run.scores), run.name.clone()));
        timed.filter_map(point).collect::<Vec<_>>()
    };
    let mut best = points(true);
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    Chart {
        title: format!("{}{}", input.name, input.spp.map_or(String::new(), |spp| format!(", {spp} spp"))),
        x: "seconds".into(),
        y: error_name(sweep).into(),
        series: vec![
            Series { name: "Pareto front".into(), points: best, line: true, discs: true },
            Series { name: "other runs".into(), points: points(false), line: false, discs: true },
        ],
    }
}

/// Error against samples per pixel: the renders and each run.
pub fn spp_chart(sweep: &Sweep) -> Chart {
    let series = |name: Option<&str>| Series {
        name: name.unwrap_or("not denoised").into(),
        points: sweep.against_spp(name).into_iter().map(|(x, y)| (x, y, String::new())).collect(),
        line: true,
        discs: true,
    };
    Chart {
        title: "Error against samples".into(),
        x: "samples per pixel".into(),
        y: error_name(sweep).into(),
        series: std::iter::once(None).chain(names(sweep).into_iter().map(Some)).map(series).collect(),
    }
}

/// Estimated against true error, one chart for each input.
pub fn calibration_charts(sweep: &Sweep) -> Vec<Chart> {
    let chart = |input: &Input| {
        let of = |run: &Run| {
            let groups = &run.calibration.as_ref()?.groups;
            let points = groups.iter().map(|&(x, y)| (x, y, String::new())).collect();
            Some(Series { name: run.name.clone(), points, line: true, discs: true })
        };
        let runs: Vec<Series> = input.runs.iter().filter_map(of).collect();
        let values = || runs.iter().flat_map(|s| &s.points).flat_map(|p| [p.0, p.1]).filter(|v| *v > 0.0);
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
        let equal = [low, high].map(|v| (v, v, String::new())).to_vec();
        let equal = Series { name: "equal".into(), points: equal, line: true, discs: false };
        Chart {
            title: format!("Estimated and true error, {}", input.name),
            x: "estimated relative squared error".into(),
            y: "true relative squared error".into(),
            series: std::iter::once(equal).chain(runs).collect(),
        }
    };
    sweep.inputs.iter().map(chart).collect()
}

/// The runs' names in the order of their first appearance.
fn names(sweep: &Sweep) -> Vec<&str> {
    let mut names: Vec<&str> = vec![];
    for run in sweep.inputs.iter().flat_map(|input| &input.runs) {
        if !names.contains(&run.name.as_str()) {
            names.push(&run.name);
        }
    }
    names
}

fn slopes(sweep: &Sweep) -> String {
    let row = |name: Option<&str>| {
        let slope = log_slope(&sweep.against_spp(name))?;
        Some(vec![name.unwrap_or("not denoised").to_string(), format!("{slope:.2}")])
    };
    let rows = std::iter::once(None).chain(names(sweep).into_iter().map(Some)).filter_map(row);
    table("Slope of log error against log samples (−1: as fast as sampling)", &["run", "slope"], rows)
}

fn equal_time(sweep: &Sweep) -> String {
    let heads = [
        "run",
        "seconds",
        error_name(sweep),
        "as good as spp",
        "break-even, s per sample",
        "samples bought",
        "the same with them",
    ];
    let of = |input: &Input| {
        let row = |run: &Run| {
            let e = sweep.equal_time(input, run)?;
            // A run that is worse than its input never pays.
            let break_even = Some(e.break_even_sample_seconds).filter(|seconds| seconds.is_finite());
            let break_even = break_even.map_or("–".into(), |seconds| format!("{seconds:.4}"));
            let (samples, error) = e.bought.map_or(("–".into(), "–".into()), |(samples, error)| {
                (format!("{samples:.1}"), format!("{error:.6}"))
            });
            Some(vec![
                run.name.clone(),
                format!("{:.3}", run.seconds?),
                format!("{:.6}", sweep.error(&run.scores)),
                format!("{:.0}", e.equivalent_spp),
                break_even,
                samples,
                error,
            ])
        };
        table(&input.name, &heads, input.runs.iter().filter_map(row))
    };
    sweep.inputs.iter().map(of).collect()
}

fn calibration(sweep: &Sweep) -> String {
    let of = |input: &Input| {
        let row = |run: &Run| {
            let c = run.calibration.as_ref()?;
            Some(vec![run.name.clone(), format!("{:.3}", c.ratio), format!("{:.3}", c.rank_correlation)])
        };
        table(
            &input.name,
            &["run", "estimated / true", "rank correlation"],
            input.runs.iter().filter_map(row),
        )
    };
    sweep.inputs.iter().map(of).collect()
}

fn scores(sweep: &Sweep) -> String {
    let heads = [
        "run",
        "seconds",
        "processor seconds",
        "relMSE",
        "relMSE trimmed",
        "RMSE",
        "SMAPE",
        "SSIM",
        "energy",
    ];
    let cells = |name: &str, seconds: [Option<f64>; 2], s: &crate::metrics::Scores| {
        let mut cells = vec![name.to_string()];
        cells.extend(seconds.map(|seconds| seconds.map_or("–".into(), |seconds| format!("{seconds:.3}"))));
        cells.extend([s.rel_mse, s.trimmed_rel_mse, s.rmse].map(|value| format!("{value:.6}")));
        cells.extend([s.smape, s.ssim].map(|value| format!("{value:.4}")));
        cells.push(format!("{:+.2} %", 100.0 * s.energy));
        cells
    };
    let of = |input: &Input| {
        let front = input.pareto_front();
        let run = |run: &Run| cells(&run.name, [run.seconds, run.processor_seconds], &run.scores);
        let runs = input.runs.iter().map(run).zip(front);
        let noisy = ("noisy", cells("not denoised", [None, None], &input.noisy));
        let rows = std::iter::once(noisy)
            .chain(runs.map(|(cells, front)| (if front { "front" } else { "" }, cells)))
            .map(|(class, cells)| row(class, &cells));
        whole_table(&input.name, &heads, rows)
    };
    sweep.inputs.iter().map(of).collect()
}

fn table(caption: &str, heads: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut rows = rows.map(|cells| row("", &cells)).peekable();
    if rows.peek().is_none() { String::new() } else { whole_table(caption, heads, rows) }
}

fn whole_table(caption: &str, heads: &[&str], rows: impl Iterator<Item = String>) -> String {
    let heads: String = heads.iter().map(|head| format!("<th>{}</th>", escape(head))).collect();
    let rows: String = rows.collect();
    format!("<table><caption>{}</caption><tr>{heads}</tr>\n{rows}</table>\n", escape(caption))
}

fn row(class: &str, cells: &[String]) -> String {
    let cells: String = cells.iter().map(|cell| format!("<td>{}</td>", escape(cell))).collect();
    format!("<tr class=\"{class}\">{cells}</tr>\n")
}

/// The pictures as JSON for the page's script, PNG in data URIs.
fn layers(sweep: &Sweep) -> String {
    let inputs: Vec<serde_json::Value> = sweep
        .inputs
        .iter()
        .map(|input| {
            let layer = |layer: &super::sweep::Layer| {
                let png = base64::engine::general_purpose::STANDARD.encode(&layer.png);
                serde_json::json!({ "name": layer.name, "png": format!("data:image/png;base64,{png}") })
            };
            serde_json::json!({
                "name": input.name,
                "layers": input.layers.iter().map(layer).collect::<Vec<_>>(),
            })
        })
        .collect();
    // HTML looks for its own marks inside scripts' strings too.
    serde_json::Value::from(inputs).to_string().replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_looks_like_a_place_in_a_value_is_none() {
        let values = [("A", "{{B}} {{".to_owned()), ("B", "b".to_owned())];
        assert_eq!(filled("<{{A}}{{B}}>", &values), "<{{B}} {{b>");
    }
}
