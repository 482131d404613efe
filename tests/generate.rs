//! Completions and manual pages know every option of every program.

#![expect(clippy::print_stderr, reason = "a skipped test says so")]

use std::process::{Command, Stdio};

const PROGRAMS: [&str; 3] =
    [env!("CARGO_BIN_EXE_apr-denoise"), env!("CARGO_BIN_EXE_apr-compare"), env!("CARGO_BIN_EXE_apr-trace")];
const SHELLS: [&str; 4] = ["complete-bash", "complete-zsh", "complete-fish", "complete-powershell"];

fn answer(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output().unwrap();
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{program} {arguments:?}: {complaint}");
    String::from_utf8(output.stdout).unwrap()
}

/// The options that a help text names where it lists them.
fn options(help: &str) -> Vec<String> {
    let lines = help.lines().map(str::trim_start).filter(|line| line.starts_with('-'));
    let words = lines.flat_map(|line| line.split([' ', ',', '=']).filter(|word| word.starts_with("--")));
    let options: Vec<String> = words.map(str::to_owned).collect();
    assert!(!options.is_empty(), "{help}");
    options
}

/// The subcommands and their help; the empty one is the program itself.
fn helps(program: &str) -> Vec<(String, String)> {
    let own = answer(program, &["--help"]);
    assert!(options(&own).len() > 5, "{own}");
    let listed = own.split_once("Commands:").map_or("", |(_, rest)| rest);
    let names = listed.lines().skip(1).take_while(|line| !line.trim().is_empty());
    let names = names.filter_map(|line| line.strip_prefix("  ")?.split(' ').next().map(str::to_owned));
    let names: Vec<String> = names.filter(|name| !name.is_empty() && name != "help").collect();
    let subcommands = names.into_iter().map(|name| {
        let help = answer(program, &[&name, "--help"]);
        (name, help)
    });
    std::iter::once((String::new(), own.clone())).chain(subcommands).collect()
}

/// Feeds `text` to a checker; whether it found nothing, or none where there is no such program.
fn checked(checker: &[&str], text: &str) -> Option<bool> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    let status = Command::new(checker[0])
        .args(&checker[1..])
        .arg(file.path())
        .stdout(Stdio::null())
        .stderr(Stdio::inherit())
        .status();
    match status {
        Ok(status) => Some(status.success()),
        Err(_) => {
            eprintln!("SKIPPED: there is no {}", checker[0]);
            None
        }
    }
}

#[test]
fn completions_offer_every_option() {
    for program in PROGRAMS {
        for shell in SHELLS {
            let script = answer(program, &["--generate", shell]);
            for option in helps(program).iter().flat_map(|(_, help)| options(help)) {
                let named = if shell == "complete-fish" { format!("-l {}", &option[2..]) } else { option };
                assert!(script.contains(&named), "{shell} of {program} lacks {named}");
            }
        }
        assert_ne!(checked(&["bash", "-n"], &answer(program, &["--generate", "complete-bash"])), Some(false));
    }
}

#[test]
fn bash_completes_options_and_their_values() {
    let script = answer(PROGRAMS[0], &["--generate", "complete-bash"]);
    let complete = |words: &str, count: usize| {
        let ask = format!(
            "{script}\nfunction=$(complete -p apr-denoise | grep -o '_apr[^ ]*')\nCOMP_WORDS=({words}); \
             COMP_CWORD={count}; $function apr-denoise \"${{COMP_WORDS[-1]}}\" \"${{COMP_WORDS[-2]}}\"; \
             echo \"${{COMPREPLY[@]}}\""
        );
        answer("bash", &["-c", &ask])
    };
    assert_eq!(complete("apr-denoise --skip", 1).trim(), "--skip-existing");
    assert_eq!(complete("apr-denoise --missing e", 2).trim(), "error");
}

#[test]
fn manual_pages_describe_every_option() {
    for program in PROGRAMS {
        for (name, help) in helps(program) {
            let kind = if name.is_empty() { "man".to_owned() } else { format!("man-{name}") };
            let page = answer(program, &["--generate", &kind]);
            let plain = page.replace("\\-", "-").replace("\\fB", "").replace("\\fR", "");
            for option in options(&help) {
                assert!(plain.contains(&option), "{kind} of {program} lacks {option}");
            }
            assert_ne!(
                checked(&["mandoc", "-T", "lint", "-W", "error"], &page),
                Some(false),
                "{kind} of {program}"
            );
        }
    }
}

#[test]
fn a_kind_that_is_none_is_told() {
    let output = Command::new(PROGRAMS[0]).args(["--generate", "tea"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("complete-fish"));
}

#[test]
fn the_page_of_options_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/OPTIONS.md");
    let page = answer(PROGRAMS[0], &["--generate", "options"]);
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(path, page).unwrap();
        panic!("the page was written anew: look at it, then test without BLESS");
    }
    let written = std::fs::read_to_string(path).unwrap();
    assert!(written == page, "docs/OPTIONS.md: write it with BLESS=1 cargo test --test all generate::");
}

/// Every option of the page is one, and what lies beyond its range is refused with the range.
#[test]
fn the_page_of_options_says_what_the_program_does() {
    let page = answer(PROGRAMS[0], &["--generate", "options"]);
    let folder = tempfile::tempdir().unwrap();
    let mut method = "apr";
    let mut ranges = 0;
    for line in page.lines() {
        if let Some(rest) = line.strip_prefix("`--method ") {
            method = rest.split('`').next().unwrap();
        }
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        let Some((key, range)) = cells.first().zip(cells.iter().rev().nth(1)) else { continue };
        let Some(key) = key.strip_prefix('`').and_then(|key| key.strip_suffix('`')) else { continue };
        let Some((_, most)) = range.split_once(" to ") else { continue };
        let whole = !most.contains('.') && most.parse::<u64>().is_ok();
        assert!(whole, "{line}");
        let key = key.replace("S.K", "0.0");
        let value = format!("{}", most.parse::<u64>().unwrap() + 1);
        let value = if key == "bandwidths" { format!("[0.5,{value}]") } else { value };
        let output = Command::new(PROGRAMS[0])
            .args(["none.exr", "out.exr", "--method", method, "--set", &format!("{key}={value}")])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{line}: {said}");
        assert!(
            said.contains(&format!("option '{key}' is ")) && said.contains(&format!("give {range}")),
            "{said}"
        );
        ranges += 1;
    }
    assert!(ranges > 20, "{page}");
}
