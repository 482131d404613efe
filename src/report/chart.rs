//! Charts on logarithmic axes, as SVG.

mod labels;

use std::fmt::Write;

use labels::Labels;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = 18.0;
/// A legend of more lines than `INSIDE` gets a column of its own, this wide, beside the axes.
const LEGEND: f64 = 190.0;
const INSIDE: usize = 3;
/// Height of one of its lines.
const ROW: f64 = 17.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 52.0;

/// What tells whose a chart is.
pub(super) const MARK: &str = concat!("<!-- ", env!("CARGO_PKG_NAME"), " -->");

/// Okabe and Ito's colours, which people with colour-blindness can tell apart.
const COLORS: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444"];

/// Dashes and gaps in pixels.
const DASHES: [&str; 3] = ["none", "6 3", "2 3"];

/// A chart of positive values on two logarithmic axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// The headline.
    pub title: String,
    /// What runs from left to right, with its unit.
    pub x: String,
    /// What runs from bottom to top, with its unit.
    pub y: String,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

/// Points of one colour. Points that are not positive and finite cannot be drawn and are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The name in the legend; none when empty.
    pub name: String,
    /// Where the points are, and a label for each (none when empty): beside the point where there is
    /// room, and in its tooltip.
    pub points: Vec<(f64, f64, String)>,
    /// Join the points by a line.
    pub line: bool,
    /// Draw a disc at each point.
    pub discs: bool,
}

/// One axis: decades that span all values.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values.map(f64::log10).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        if low > high {
            return Self { low: 0.0, high: 1.0, from, to };
        }
        let margin = 0.06 * (high - low).max(0.5);
        Self { low: low - margin, high: high + margin, from, to }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (self.to - self.from) * (value.log10() - self.low) / (self.high - self.low)
    }

    /// 1, 2 and 5 of each decade in range; of many decades only the powers of ten.
    fn ticks(&self) -> Vec<f64> {
        let steps: &[f64] = if self.high - self.low > 2.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let decades = self.low.floor() as i32..=self.high.ceil() as i32;
        decades
            .flat_map(|decade| steps.iter().map(move |step| step * 10f64.powi(decade)))
            .filter(|value| (self.low..=self.high).contains(&value.log10()))
            .collect()
    }
}

impl Chart {
    /// The chart as a complete `<svg>` element that needs nothing else.
    pub fn svg(&self) -> String {
        let drawn = || self.series.iter().flat_map(|s| &s.points).filter(|(x, y, _)| drawable(*x, *y));
        let x = Axis::new(drawn().map(|p| p.0), LEFT, WIDTH - RIGHT);
        let y = Axis::new(drawn().map(|p| p.1), HEIGHT - BOTTOM, TOP);
        let named = self.series.iter().filter(|series| !series.name.is_empty()).count();
        let width = WIDTH + if named > INSIDE { LEGEND } else { 0.0 };
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {HEIGHT}\" width=\"{width}\" \
             font-family=\"system-ui,sans-serif\" font-size=\"12\" fill=\"#222\">{MARK}\n\
             <rect width=\"{width}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
        );
        text(&mut svg, LEFT, 20.0, "font-weight=\"600\" font-size=\"14\"", &self.title);
        self.grid(&mut svg, &x, &y);
        let frame = [LEFT, TOP, WIDTH, HEIGHT - BOTTOM];
        let mut labels = Labels::new(frame, drawn().map(|point| (x.at(point.0), y.at(point.1))));
        if named <= INSIDE {
            labels.cover([WIDTH - RIGHT - 130.0, TOP, WIDTH, TOP + ROW * named as f64]);
        }
        for (i, series) in self.series.iter().enumerate() {
            series.draw(&mut svg, &x, &y, i, &mut labels);
        }
        self.legend(&mut svg, width - RIGHT);
        svg + "</svg>\n"
    }

    fn grid(&self, svg: &mut String, x: &Axis, y: &Axis) {
        let mut line = |x1: f64, y1: f64, x2: f64, y2: f64| {
            put(svg, format_args!("<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"#ddd\"/>\n"));
        };
        x.ticks().iter().for_each(|&v| line(x.at(v), TOP, x.at(v), HEIGHT - BOTTOM));
        y.ticks().iter().for_each(|&v| line(LEFT, y.at(v), WIDTH - RIGHT, y.at(v)));
        for value in x.ticks() {
            text(svg, x.at(value), HEIGHT - BOTTOM + 17.0, "text-anchor=\"middle\"", &short(value));
        }
        for value in y.ticks() {
            text(svg, LEFT - 7.0, y.at(value) + 4.0, "text-anchor=\"end\"", &short(value));
        }
        let middle = (LEFT + WIDTH - RIGHT) / 2.0;
        text(svg, middle, HEIGHT - 12.0, "text-anchor=\"middle\"", &self.x);
        let upright = format!("text-anchor=\"middle\" transform=\"rotate(-90 16 {:.0})\"", HEIGHT / 2.0);
        text(svg, 16.0, HEIGHT / 2.0, &upright, &self.y);
    }

    /// Names right-aligned before their marks, which end at `edge`.
    fn legend(&self, svg: &mut String, edge: f64) {
        let named: Vec<_> =
            self.series.iter().enumerate().filter(|(_, series)| !series.name.is_empty()).collect();
        // A long list closes up rather than leave the chart.
        let height = ROW.min((HEIGHT - TOP - ROW) / named.len() as f64);
        for (row, (i, series)) in named.into_iter().enumerate() {
            let y = TOP + 14.0 + height * row as f64;
            let (left, right) = (edge - 36.0, edge - 10.0);
            if series.line {
                stroke(svg, &format!("{left} {:.1}L{right} {:.1}", y - 4.0, y - 4.0), i);
            }
            if series.discs {
                disc(svg, (left + right) / 2.0, y - 4.0, i, "");
            }
            text(svg, left - 8.0, y, "text-anchor=\"end\"", &series.name);
        }
    }
}

impl Series {
    /// Draws the chart's series number `i`.
    fn draw(&self, svg: &mut String, x: &Axis, y: &Axis, i: usize, labels: &mut Labels) {
        let points: Vec<(f64, f64, &str)> = self
            .points
            .iter()
            .filter(|(px, py, _)| drawable(*px, *py))
            .map(|(px, py, label)| (x.at(*px), y.at(*py), label.as_str()))
            .collect();
        if self.line && points.len() > 1 {
            let path: Vec<String> = points.iter().map(|(px, py, _)| format!("{px:.1} {py:.1}")).collect();
            stroke(svg, &path.join("L"), i);
        }
        for (px, py, label) in points {
            if self.discs {
                disc(svg, px, py, i, label);
            }
            if !label.is_empty()
                && let Some((left, base)) = labels.place(px, py, label)
            {
                text(svg, left, base, "font-size=\"11\"", label);
            }
        }
    }
}

/// A line in the style of series `i`: after every colour the next sort of dashes.
fn stroke(svg: &mut String, path: &str, i: usize) {
    let (color, dashes) = (COLORS[i % COLORS.len()], DASHES[i / COLORS.len() % DASHES.len()]);
    let style = format_args!(
        "<path d=\"M{path}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\" \
         stroke-dasharray=\"{dashes}\"/>\n"
    );
    put(svg, style);
}

/// A disc in the colour of series `i` with a tooltip.
fn disc(svg: &mut String, x: f64, y: f64, i: usize, tip: &str) {
    let color = COLORS[i % COLORS.len()];
    let tip = super::escape(tip);
    let disc = format_args!(
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{color}\"><title>{tip}</title></circle>\n"
    );
    put(svg, disc);
}

fn drawable(x: f64, y: f64) -> bool {
    x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()
}

fn text(svg: &mut String, x: f64, y: f64, style: &str, words: &str) {
    put(svg, format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{}</text>\n", super::escape(words)));
}

fn put(svg: &mut String, what: std::fmt::Arguments) {
    svg.write_fmt(what).expect("writing into a String cannot fail");
}

/// A tick's value in as few characters as it takes.
fn short(value: f64) -> String {
    if (0.001..10_000.0).contains(&value) {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        format!("{value:.0e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> String {
        let points = points.iter().map(|&(x, y)| (x, y, "a<b".to_string())).collect();
        let series = Series { name: "s".into(), points, line: true, discs: true };
        Chart { title: "t".into(), x: "x".into(), y: "y".into(), series: vec![series] }.svg()
    }

    fn centres(svg: &str) -> Vec<(f64, f64)> {
        let value = |line: &str, key: &str| {
            let from = line.find(key).unwrap() + key.len();
            line[from..].split('"').next().unwrap().parse().unwrap()
        };
        let discs = svg.lines().filter(|line| line.starts_with("<circle"));
        discs.map(|line| (value(line, "cx=\""), value(line, "cy=\""))).collect()
    }

    #[test]
    fn equal_ratios_are_equal_distances_and_more_is_right_and_up() {
        let at = centres(&chart(&[(1.0, 0.001), (10.0, 0.01), (100.0, 0.1)]));
        assert!((at[1].0 - at[0].0 - (at[2].0 - at[1].0)).abs() < 0.11);
        assert!(at[0].0 < at[1].0 && at[0].1 > at[1].1);
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out_and_words_are_escaped() {
        let svg = chart(&[(1.0, 1.0), (0.0, 1.0), (1.0, f64::NAN), (1.0, f64::INFINITY)]);
        assert_eq!(centres(&svg).len(), 2); // the one point and the legend's disc
        assert!(svg.contains("a&lt;b") && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(centres(&chart(&[])).len() == 1);
    }

    #[test]
    fn the_longest_legend_stays_in_the_chart() {
        let series = |i: usize| Series { name: i.to_string(), points: vec![], line: false, discs: true };
        for count in [1, 4, 22, 40] {
            let series = (0..count).map(series).collect();
            let chart = Chart { title: "t".into(), x: "x".into(), y: "y".into(), series };
            let rows = centres(&chart.svg());
            assert_eq!(rows.len(), count);
            assert!(
                rows.windows(2).all(|pair| pair[1].1 > pair[0].1 + 8.0) && rows[count - 1].1 < HEIGHT - 6.0
            );
        }
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([short(1.0), short(0.005), short(1e-5), short(200.0)], ["1", "0.005", "1e-5", "200"]);
    }
}
