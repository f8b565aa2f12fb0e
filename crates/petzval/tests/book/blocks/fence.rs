//! Blocks of a page: what a fence holds, and what its first line says of it.

/// A fenced block of a page.
#[derive(Debug)]
pub struct Block {
    /// Line of the fence in the page, from 1.
    pub line: usize,
    /// Its language: `sh`, `toml`, `python`, `text`, ...
    pub language: String,
    /// What it holds.
    pub text: String,
    /// Options that make its commands short, as words.
    pub short: Vec<String>,
    /// Why it cannot run here.
    pub skip: Option<String>,
    /// The file that it is: it is written under this name, for later blocks, and not run.
    pub file: Option<String>,
}

/// Why a block cannot run: the reasons that a fence may give.
pub const REASONS: &[(&str, &str)] = &[
    ("build", "compiles programs, or installs them"),
    ("pip", "installs packages of Python"),
    ("network", "fetches something"),
    ("cluster", "needs Slurm, HyperQueue, Ray, or several machines"),
    ("browser", "needs a browser, or serves until it is stopped"),
    ("gpu", "needs a GPU"),
    ("torch", "needs PyTorch; the tests of the Python package run it"),
    ("own-data", "needs files that only its reader has"),
    ("hours", "takes hours, and no option makes it short"),
    ("other-program", "is a file of another program"),
];

/// The fenced blocks of a page. A key of a fence that is not known is an error with its line.
pub fn blocks(page: &str) -> Result<Vec<Block>, String> {
    let mut found = Vec::new();
    let mut lines = page.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let Some(info) = line.trim_start().strip_prefix("```") else { continue };
        let indent = line.len() - line.trim_start().len();
        let body = lines.by_ref().map(|(_, line)| line).take_while(|line| line.trim_start() != "```");
        let text: Vec<&str> = body.map(|line| line.get(indent..).unwrap_or(line.trim_start())).collect();
        let language: String = info.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
        let mut block = Block {
            line: number + 1,
            text: text.join("\n") + "\n",
            short: Vec::new(),
            skip: None,
            file: None,
            language,
        };
        let keys = info[block.language.len()..].trim_start_matches([',', ' ']);
        if ["sh", "toml", "python"].contains(&block.language.as_str()) {
            read_keys(keys, &mut block).map_err(|what| format!("line {}: {what}", number + 1))?;
        }
        found.push(block);
    }
    Ok(found)
}

/// Reads `short=OPTIONS`, which goes to the end of the line, `skip=REASON` and `file=NAME`.
fn read_keys(keys: &str, block: &mut Block) -> Result<(), String> {
    let mut rest = keys;
    while !rest.is_empty() {
        let Some((key, value)) = rest.split_once('=') else {
            return Err(format!("`{rest}` is no key with a value"));
        };
        if key == "short" {
            block.short = value.split_whitespace().map(str::to_owned).collect();
            return Ok(());
        }
        let (value, after) = value.split_once([',', ' ']).unwrap_or((value, ""));
        rest = after.trim_start();
        match key {
            "skip" if REASONS.iter().any(|(reason, _)| *reason == value) => {
                block.skip = Some(value.to_owned())
            }
            "skip" => {
                let known: Vec<&str> = REASONS.iter().map(|(reason, _)| *reason).collect();
                return Err(format!("skip={value}: not one of {}", known.join(", ")));
            }
            "file" => block.file = Some(value.to_owned()),
            other => return Err(format!("`{other}` is none of short, skip, file")),
        }
    }
    Ok(())
}

#[test]
fn fences_say_how_their_blocks_run() {
    let page = "a\n```sh short=--steps 2 --trials 3\npetzval x\n```\n  ```toml,file=a.toml\n  b = 1\n  ```\n```sh skip=pip\n```\n```text any=thing\n```\n";
    let found = blocks(page).unwrap();
    assert_eq!(found.iter().map(|block| block.line).collect::<Vec<_>>(), [2, 5, 8, 10]);
    assert_eq!(found[0].short, ["--steps", "2", "--trials", "3"]);
    assert_eq!((found[1].file.as_deref(), found[1].text.as_str()), (Some("a.toml"), "b = 1\n"));
    assert_eq!(found[2].skip.as_deref(), Some("pip"));
    for (wrong, says) in
        [("skip=lazy", "skip=lazy: not one of build"), ("slow=1", "`slow`"), ("whatever", "`whatever`")]
    {
        let error = blocks(&format!("```sh {wrong}\n```\n")).unwrap_err();
        assert!(error.starts_with("line 1: ") && error.contains(says), "{error}");
    }
}
