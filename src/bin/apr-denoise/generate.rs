//! `--generate`: shell completions and manual pages, from the one definition of the command line, and further pages.

use clap::builder::PossibleValuesParser;
use clap::{Arg, ArgMatches, Command, CommandFactory, FromArgMatches};
use clap_complete::Shell;

use crate::answer;

const NAME: &str = "generate";
const MANUAL: &str = "man";
const SHELLS: [(&str, Shell); 4] = [
    ("complete-bash", Shell::Bash),
    ("complete-zsh", Shell::Zsh),
    ("complete-fish", Shell::Fish),
    ("complete-powershell", Shell::PowerShell),
];

/// A page that only some program has: its kind, what it is, and how it is made.
pub type Page = (&'static str, &'static str, fn() -> String);

/// Parses the command line like [`clap::Parser::parse`]; answers `--generate`, of the program's own `pages` too, and
/// ends the program.
pub fn parse<P: CommandFactory + FromArgMatches>(pages: &[Page]) -> P {
    let mut command = with_generate(P::command(), pages);
    let matches = command.get_matches_mut();
    if let Some(text) = generated(&mut command, &matches, pages) {
        let written = answer::write(&text).inspect_err(|error| answer::complain(&error.to_string()));
        std::process::exit(written.map_or_else(|error| error.kind().exit_code().into(), |()| 0));
    }
    P::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
}

fn with_generate(command: Command, pages: &[Page]) -> Command {
    let subcommands = command.get_subcommands().map(|sub| format!("{MANUAL}-{}", sub.get_name()));
    let kinds: Vec<String> = std::iter::once(MANUAL.to_owned())
        .chain(subcommands)
        .chain(pages.iter().map(|(kind, ..)| (*kind).to_owned()))
        .chain(SHELLS.iter().map(|(kind, _)| (*kind).to_owned()))
        .collect();
    let pages: String = pages.iter().map(|(_, what, _)| format!(", {what}")).collect();
    command.arg(
        Arg::new(NAME)
            .long(NAME)
            .value_name("KIND")
            .value_parser(PossibleValuesParser::new(kinds))
            .exclusive(true)
            .help(format!("Print the manual page (roff){pages} or the completions of a shell, and stop")),
    )
}

fn generated(command: &mut Command, matches: &ArgMatches, pages: &[Page]) -> Option<Vec<u8>> {
    let kind = matches.get_one::<String>(NAME)?;
    if let Some((.., page)) = pages.iter().find(|(name, ..)| name == kind) {
        return Some(page().into_bytes());
    }
    let mut text = Vec::new();
    if let Some((_, shell)) = SHELLS.iter().find(|(name, _)| name == kind) {
        let name = command.get_name().to_owned();
        clap_complete::generate(*shell, command, name, &mut text);
        return Some(text);
    }
    command.build(); // gives subcommands their full names
    let sub = kind.strip_prefix(MANUAL).and_then(|rest| rest.strip_prefix('-'));
    let page = sub.and_then(|sub| command.find_subcommand(sub)).unwrap_or(command).clone();
    clap_mangen::Man::new(page).render(&mut text).expect("memory takes all");
    Some(text)
}
