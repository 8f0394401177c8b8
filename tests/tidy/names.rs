//! Rules about names: what a type, module or file must not be called, and what it is called here.

use super::lexer::{code, identifiers};

/// A word that names nothing, or that has another name here, and what to do.
const FORBIDDEN: [(&str, &str); 24] = [
    ("bag", "rays bound for one place are a bundle"),
    ("batch", "rays bound for one place are a bundle"),
    ("brdf", "say bsdf"),
    ("canvas", "it is the film, or the image developed from it"),
    ("cmd", "say action"),
    ("data", "say what the data is"),
    ("engine", "it is a core or a driver"),
    ("framebuffer", "it is the film, or the image developed from it"),
    ("handler", "say what it does"),
    ("helper", "say what it does"),
    ("helpers", "say what they do"),
    ("info", "say what it tells"),
    ("manager", "say what it does"),
    ("misc", "say what it holds"),
    ("msg", "say event or message"),
    ("nee", "it is a shadow ray"),
    ("packet", "rays bound for one place are a bundle"),
    ("registry", "those who take part are the roster"),
    ("splat", "it is a contribution"),
    ("tick", "say now or deadline"),
    ("timestamp", "say time"),
    ("util", "say what it does"),
    ("utils", "say what they do"),
    ("utility", "say what it does"),
];

/// Words after which a type or a module gets its name.
const DECLARING: [&str; 6] = ["enum", "mod", "struct", "trait", "type", "union"];

/// A file is named for the noun it holds.
pub(crate) fn stem(path: &str) -> Vec<String> {
    let file = path.rsplit('/').next().unwrap_or(path);
    complaints(file.split('.').next().unwrap_or(file))
}

/// So is every type and module.
pub(crate) fn declared(text: &str) -> Vec<String> {
    let code = code(text);
    let mut declares = false;
    let names = identifiers(&code)
        .filter(|(identifier, _)| std::mem::replace(&mut declares, DECLARING.contains(identifier)));
    names.flat_map(|(name, _)| complaints(name)).collect()
}

fn complaints(name: &str) -> Vec<String> {
    let words = words(name);
    let found = FORBIDDEN.iter().filter(|(word, _)| words.iter().any(|it| it == word));
    found.map(|(word, remedy)| format!("`{name}`: not `{word}`; {remedy}")).collect()
}

/// The words of a name in either case: `FilmInfo` and `film_info` have the same.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut was_upper = true;
    for c in name.chars() {
        if c == '_' || (c.is_uppercase() && !was_upper) {
            words.push(String::new());
        }
        if let (true, Some(word)) = (c != '_', words.last_mut()) {
            word.extend(c.to_lowercase());
        }
        was_upper = c.is_uppercase();
    }
    words
}

mod tests {
    use super::*;

    #[test]
    fn names_have_words() {
        assert_eq!(words("FilmInfo"), ["film", "info"]);
        assert_eq!(words("film_info"), ["film", "info"]);
        assert_eq!(words("BSDF"), ["bsdf"]);
    }

    #[test]
    fn an_empty_name_is_found() {
        for text in ["struct SceneManager;", "mod util {}", "enum RayInfo {}", "type Brdf = u8;"] {
            assert_eq!(declared(text).len(), 1, "{text}");
        }
        for text in ["// struct Manager", "struct Managed;", "fn data() {}", "struct Utilized;"] {
            assert!(declared(text).is_empty(), "{text}");
        }
        assert_eq!(stem("worker/src/job_manager.rs").len(), 1);
        assert!(stem("util/src/job.rs").is_empty(), "directories are packages");
    }
}
