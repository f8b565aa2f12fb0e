//! Every lens that is built in, read from its file.

/// Every lens of `crates/petzval-data/data/lenses`.
pub fn all_lenses() -> Vec<petzval_files::LensFile> {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
    let toml_files = |folder: &str| -> Vec<String> {
        let mut paths: Vec<_> =
            std::fs::read_dir(data.join(folder)).unwrap().map(|e| e.unwrap().path()).collect();
        paths.sort();
        paths
            .iter()
            .filter(|p| p.extension().is_some_and(|e| e == "toml"))
            .map(|p| std::fs::read_to_string(p).unwrap())
            .collect()
    };
    let mut catalog = petzval_optics::glass::Catalog::default();
    for text in toml_files("glasses") {
        catalog.merge(petzval_files::parse_catalog(&text).unwrap());
    }
    toml_files("lenses").iter().map(|t| petzval_files::parse_lens(t, &catalog).unwrap()).collect()
}
