//! `--generate options`: every option that `--set` takes, in Markdown, from the options' own descriptions.

use std::fmt::Write;

use apr::Options;
use apr::baseline::{Denoiser, Method};
use apr::options::Key;

/// The preset that is there when none is named, which the others are told against.
const FIRST: &str = "balanced";

/// What begins the names of the kernels' own options.
const KERNELS: &str = "stages.";

/// docs/OPTIONS.md.
pub fn page() -> String {
    let mut presets: Vec<_> = Options::PRESETS.map(|(name, preset)| (name, preset().keys())).to_vec();
    presets.sort_by_key(|(name, _)| *name != FIRST);
    let mut page = "# Options of the denoiser\n\n\
        `--set KEY=VALUE` sets one, `--options FILE.json` those of a JSON object such as `{\"max_order\": 2}`; VALUE is \
        JSON, quotes around a word may be left out. `--preset` comes first, then the file, then each `--set` in turn. \
        `apr-denoise --generate options` prints this page.\n\n\
        An empty cell is as balanced. Why a default is what it is stands at its field in \
        [options.rs](../src/options.rs). `--method student` takes these options too and starts from its own.\n\n"
        .to_owned();
    main_table(&mut page, &presets);
    kernel_tables(&mut page, &presets);
    page += "\n## Other methods\n";
    for (name, method) in Method::NAMES {
        let denoiser = Denoiser::new(method);
        if denoiser.pipeline().is_none() {
            let _ = write!(page, "\n`--method {name}`: {}.\n\n", method.publication());
            page += &row(&["option", "default", "range", "meaning"].map(str::to_owned));
            page += "|---|---|---|---|\n";
            for key in denoiser.keys() {
                page += &row(&[code(&key.name), code(&key.value), key.range, key.meaning]);
            }
        }
    }
    page
}

fn main_table(page: &mut String, presets: &[(&str, Vec<Key>)]) {
    let names = presets.iter().map(|(name, _)| (*name).to_owned());
    let ends = |end: &[&str]| end.iter().map(|end| (*end).to_owned()).collect::<Vec<_>>();
    page.push_str(&row(&[ends(&["option"]), names.collect(), ends(&["range", "meaning"])].concat()));
    page.push_str(&format!("|---{}|---|---|\n", "|---".repeat(presets.len())));
    for key in presets[0].1.iter().filter(|key| !key.name.starts_with(KERNELS)) {
        let of = |(_, keys): &(&str, Vec<Key>)| value(keys, &key.name);
        let first = of(&presets[0]);
        let others =
            presets[1..].iter().map(of).map(|value| if value == first { String::new() } else { value });
        let values = std::iter::once(first.clone()).chain(others);
        // Those of the kernels would be as long as the page.
        let values = values.map(|value| match (key.name.as_str(), value.is_empty()) {
            (_, true) => value,
            ("stages", false) => "[below](#kernels)".to_owned(),
            _ => code(&value),
        });
        let end = vec![key.range.clone(), key.meaning.clone()];
        page.push_str(&row(&[vec![code(&key.name)], values.collect(), end].concat()));
    }
}

fn kernel_tables(page: &mut String, presets: &[(&str, Vec<Key>)]) {
    let first = format!("{KERNELS}0.0.");
    let fields: Vec<&Key> = presets[0].1.iter().filter(|key| key.name.starts_with(&first)).collect();
    page.push_str(
        "\n## Kernels\n\nA kernel is a family of weights. `stages.1.0.bandwidth=0.8` changes the first one of the second \
         stage, `stages=[[{\"patch_radius\": 1, \"bandwidth\": 1}]]` replaces all.\n\n",
    );
    page.push_str(&row(&["option", "range", "meaning"].map(str::to_owned)));
    page.push_str("|---|---|---|\n");
    for key in &fields {
        let name = key.name.replacen("0.0", "S.K", 1);
        page.push_str(&row(&[code(&name), key.range.clone(), key.meaning.clone()]));
    }
    let fields: Vec<&str> = fields.iter().map(|key| &key.name[first.len()..]).collect();
    let head = ["preset", "kernel"].into_iter().chain(fields.iter().copied());
    page.push('\n');
    page.push_str(&row(&head.map(str::to_owned).collect::<Vec<_>>()));
    page.push_str(&format!("{}|\n", "|---".repeat(2 + fields.len())));
    for (preset, keys) in presets {
        let of_first = |key: &&Key| key.name.starts_with(KERNELS) && key.name.ends_with(fields[0]);
        for kernel in keys.iter().filter(of_first).map(|key| key.name.trim_end_matches(fields[0])) {
            let values = fields.iter().map(|field| code(&value(keys, &format!("{kernel}{field}"))));
            let names = vec![(*preset).to_owned(), code(kernel.trim_end_matches('.'))];
            page.push_str(&row(&names.into_iter().chain(values).collect::<Vec<_>>()));
        }
    }
}

fn value(keys: &[Key], name: &str) -> String {
    keys.iter().find(|key| key.name == name).map_or(String::new(), |key| key.value.clone())
}

fn code(text: &str) -> String {
    format!("`{}`", text.replace(',', ", "))
}

fn row(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}
