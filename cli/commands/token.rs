//! `flyby token`: tokens, by which users and workers on other machines reach the farm.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use model::{Digest, Span};
use serde::Serialize;
use wire::proto::{self, ListTokensRequest, RevokeTokenRequest};
use wire::tls::certificate::{moment, now};
use wire::tls::token_file::TokenFile;

use crate::error::{Ending, Error};
use crate::farm::link::{block_on, refused};
use crate::options::{Context, FarmOptions};
use crate::output::{self, Report, columns};
use crate::values;

/// How long a token for workers can be used unless told otherwise.
const WORKERS_LIFE: Span = Span::from_secs(3_600);

/// How long one for users can.
const USERS_LIFE: Span = Span::from_secs(30 * 86_400);

#[derive(Subcommand, Debug)]
pub(crate) enum TokenCommand {
    /// Makes a token for somebody on another machine: one line, which is a secret.
    Create(Create),
    /// Lists the tokens, and what became of them.
    List(List),
    /// Ends a token and all certificates that were got by it, at once: its workers lose their links, and come back
    /// only with another token. Frames and blocks that they delivered stay.
    Revoke(Revoke),
}

#[derive(Args, Debug)]
pub(crate) struct Create {
    /// What it allows. Of view, submit and operate each includes those before it.
    #[arg(long, value_enum, default_value_t)]
    role: Role,

    /// How many workers may join by it, 1 to 100000; only for workers [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    uses: Option<u32>,

    /// How long it can be used, such as 12 h [default: 1 h for workers, 30 d for others]. Workers that have joined stay.
    #[arg(long, value_name = "TIME", value_parser = values::span)]
    expires: Option<Span>,

    /// Write it into this file, which must not be there yet, and which only its owner can read; else it is printed.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct List {
    #[command(flatten)]
    farm: FarmOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Revoke {
    /// Its number, as `token list` says it.
    id: u64,

    #[command(flatten)]
    farm: FarmOptions,
}

/// What a token allows.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, ValueEnum)]
enum Role {
    /// Join as a worker, and nothing else.
    #[default]
    Worker,
    /// Look at jobs, frames and workers.
    View,
    /// Submit jobs, and command any job.
    Submit,
    /// Drain workers, clean up, make and revoke tokens.
    Operate,
}

impl From<Role> for proto::Role {
    fn from(role: Role) -> Self {
        match role {
            Role::Worker => Self::Worker,
            Role::View => Self::View,
            Role::Submit => Self::Submit,
            Role::Operate => Self::Operate,
        }
    }
}

/// A role as it is written.
fn role_name(role: proto::Role) -> &'static str {
    match role {
        proto::Role::Unspecified => "unknown",
        proto::Role::View => "view",
        proto::Role::Submit => "submit",
        proto::Role::Operate => "operate",
        proto::Role::Worker => "worker",
    }
}

/// Runs the command.
pub(crate) fn run(context: &Context, command: TokenCommand) -> Result<Ending, Error> {
    match command {
        TokenCommand::Create(options) => block_on(create(context, &options)),
        TokenCommand::List(options) => block_on(list(context, &options)),
        TokenCommand::Revoke(options) => block_on(revoke(context, &options)),
    }
}

async fn create(context: &Context, options: &Create) -> Result<Ending, Error> {
    let usual = match options.role {
        Role::Worker => WORKERS_LIFE,
        _ => USERS_LIFE,
    };
    let life = options.expires.unwrap_or(usual);
    let mut farm = context.connect(&options.farm).await?;
    let attempt = "cannot make a token";
    // The file comes first: a token that cannot be written down is worth nothing.
    let file = options.out.as_deref().map(claim).transpose()?;
    let request = proto::CreateTokenRequest {
        role: proto::Role::from(options.role).into(),
        uses: options.uses,
        life_s: life.0.div_ceil(1_000_000),
    };
    let made = match farm.create_token(request).await {
        Ok(answer) => answer.into_inner(),
        Err(status) => {
            if let Some(path) = &options.out {
                let _ = std::fs::remove_file(path);
            }
            return Err(refused(attempt, status));
        }
    };
    let loopback_only = made.loopback_only;
    let (token, line) = token_line(made)?;
    if loopback_only {
        output::say(
            "note: this coordinator listens on loopback alone, so that only a tunnel leads to it from elsewhere; \
             start it with `--listen 0.0.0.0:7359` to have it reached",
        );
    }
    let report = Created {
        token: Token::from(token),
        line: line.reveal(),
        addresses: line.addresses,
        file: options.out.clone(),
    };
    if let Some(mut file) = file {
        let written = writeln!(file, "{}", report.line).and_then(|()| file.sync_all());
        written.map_err(|error| Error::failed(attempt).because(error))?;
    }
    output::print(context.output, &report)?;
    Ok(Ending::Done)
}

fn claim(path: &Path) -> Result<std::fs::File, Error> {
    OpenOptions::new()
        .create_new(true)
        .write(true)
        .mode(0o600)
        .open(path)
        .map_err(|error| {
            Error::failed(format!(
                "cannot make the file `{}` for the token",
                path.display()
            ))
            .because(error)
        })
}

fn token_line(made: proto::CreatedToken) -> Result<(proto::Token, TokenFile), Error> {
    let strange =
        || Error::failed("the coordinator made a token that this program does not understand");
    let token = made.token.ok_or_else(strange)?;
    let authority = <[u8; 32]>::try_from(made.authority).map_err(|_| strange())?;
    let line = TokenFile {
        id: token.id,
        role: role_name(token.role()).to_owned(),
        secret: made.secret.parse().map_err(|_| strange())?,
        authority: Digest(authority),
        addresses: made.addresses,
    };
    Ok((token, line))
}

async fn list(context: &Context, options: &List) -> Result<Ending, Error> {
    let mut farm = context.connect(&options.farm).await?;
    let answer = farm.list_tokens(ListTokensRequest {}).await;
    let answer = answer.map_err(|status| refused("cannot list the tokens", status))?;
    let tokens = answer.into_inner().tokens.into_iter().map(Token::from);
    let report = Tokens {
        tokens: tokens.collect(),
    };
    output::print(context.output, &report)?;
    Ok(Ending::Done)
}

async fn revoke(context: &Context, options: &Revoke) -> Result<Ending, Error> {
    let mut farm = context.connect(&options.farm).await?;
    let answer = farm
        .revoke_token(RevokeTokenRequest { id: options.id })
        .await;
    let answer =
        answer.map_err(|status| refused(format!("cannot revoke token {}", options.id), status))?;
    let report = Revoked {
        token: Token::from(answer.into_inner()),
    };
    output::print(context.output, &report)?;
    Ok(Ending::Done)
}

/// A token, without its secret.
#[derive(Serialize)]
struct Token {
    /// Its number.
    id: u64,
    /// What it allows.
    role: &'static str,
    /// When it was made, milliseconds since 1970 (UTC).
    made_unix_ms: u64,
    /// Until when it can be used.
    expires_unix_ms: u64,
    /// How many workers may join by it; null for users' tokens.
    uses: Option<u32>,
    /// How many have.
    used: u32,
    /// When it was revoked; null where it was not.
    revoked_unix_ms: Option<u64>,
    /// Until when certificates got by it would count; 0 where there are none.
    certificates_until_unix_ms: u64,
}

impl From<proto::Token> for Token {
    fn from(token: proto::Token) -> Self {
        Self {
            id: token.id,
            role: role_name(token.role()),
            made_unix_ms: token.made_unix_ms,
            expires_unix_ms: token.expires_unix_ms,
            uses: token.uses,
            used: token.used,
            revoked_unix_ms: token.revoked_unix_ms,
            certificates_until_unix_ms: token.certificates_until_unix_ms,
        }
    }
}

impl Token {
    fn uses(&self) -> String {
        match self.uses {
            Some(uses) => format!("{} of {uses}", self.used),
            None => "-".to_owned(),
        }
    }

    fn state(&self) -> String {
        let at = |unix_ms: u64| moment(unix_ms / 1_000);
        match self.revoked_unix_ms {
            Some(revoked) => format!("revoked {}", at(revoked)),
            None if self.expires_unix_ms / 1_000 < now() => {
                format!("expired {}", at(self.expires_unix_ms))
            }
            None if self.uses.is_some_and(|uses| self.used >= uses) => "used up".to_owned(),
            None => format!("until {}", at(self.expires_unix_ms)),
        }
    }

    fn certificates(&self) -> String {
        match self.certificates_until_unix_ms {
            0 => "-".to_owned(),
            until => format!("until {}", moment(until / 1_000)),
        }
    }
}

/// `token create`.
#[derive(Serialize)]
struct Created {
    /// The token.
    token: Token,
    /// The line that its holder needs: a secret.
    line: String,
    /// Where it leads.
    addresses: Vec<String>,
    /// The file that holds the line; null where none was asked for.
    file: Option<PathBuf>,
}

impl Report for Created {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let Some(file) = &self.file else {
            return writeln!(out, "{}", self.line);
        };
        let Token { id, role, .. } = &self.token;
        let (file, places) = (file.display(), self.addresses.join(" and "));
        writeln!(
            out,
            "Token {id} for the role `{role}` is in {file}; it leads to {places}."
        )?;
        match *role {
            "worker" => writeln!(
                out,
                "Start workers with `flyby worker --token-file {file}`."
            ),
            _ => writeln!(out, "Use it as in `flyby --token-file {file} job list`."),
        }
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        match &self.file {
            Some(_) => writeln!(out, "{}", self.token.id),
            None => writeln!(out, "{}", self.line),
        }
    }
}

/// `token list`.
#[derive(Serialize)]
struct Tokens {
    /// All that are remembered, oldest first.
    tokens: Vec<Token>,
}

impl Report for Tokens {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = columns(["token", "role", "used", "state", "certificates"]);
        for token in &self.tokens {
            table.add_row([
                token.id.to_string(),
                token.role.to_owned(),
                token.uses(),
                token.state(),
                token.certificates(),
            ]);
        }
        writeln!(out, "{table}")
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut tokens = self.tokens.iter();
        tokens.try_for_each(|token| writeln!(out, "{}", token.id))
    }
}

/// `token revoke`.
#[derive(Serialize)]
struct Revoked {
    /// The token, as it now is.
    token: Token,
}

impl Report for Revoked {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Token {} is {}. Nobody gets in by it any more, nor by a certificate that was got by it; links of its workers are ended. What they delivered stays.",
            self.token.id,
            self.token.state()
        )
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.token.id)
    }
}
