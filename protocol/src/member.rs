//! Members of a session: processes with a role.

use std::{
    fmt,
    hash::{BuildHasher, RandomState},
    str::FromStr,
    time::SystemTime,
};

/// The part of a process in a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Simulates the arm; owns the clock and the scenario. On Zenoh it listens, and all others
    /// connect.
    Plant,
    /// Answers states with torques.
    Controller,
    /// Displays and records; sends nothing.
    Monitor,
    /// Changes a running loop by requests, and may read everything.
    Operator,
}

impl Role {
    /// All roles, in the order of their numbers on the wire.
    pub const ALL: [Self; 4] = [Self::Plant, Self::Controller, Self::Monitor, Self::Operator];

    /// The name in announcements and certificates.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plant => "plant",
            Self::Controller => "controller",
            Self::Monitor => "monitor",
            Self::Operator => "operator",
        }
    }
}

/// A process that takes part in a session.
///
/// Announcements write it as `role/id/precedence/since_ns`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Member {
    /// Its part in the session.
    pub role: Role,
    /// A number that no other member has; not 0.
    pub id: u64,
    /// The controller with the highest becomes the leader.
    pub precedence: u32,
    /// When it joined, ns since 1970, by its own clock.
    pub since_ns: u64,
}

impl Member {
    /// A new member with a random number.
    pub fn new(role: Role, precedence: u32) -> Self {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let since_ns = since.as_nanos() as u64;
        // The standard library draws its hash keys at random.
        let drawn = RandomState::new().hash_one((since_ns, std::process::id()));
        Self { role, id: drawn.max(1), precedence, since_ns }
    }
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}/{}", self.role.name(), self.id, self.precedence, self.since_ns)
    }
}

/// The text does not announce a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected role/id/precedence/since_ns")]
pub struct ParseMemberError;

impl FromStr for Member {
    type Err = ParseMemberError;

    fn from_str(text: &str) -> Result<Self, ParseMemberError> {
        let mut parts = text.split('/');
        let mut next = || parts.next().ok_or(ParseMemberError);
        let name = next()?;
        let role =
            Role::ALL.into_iter().find(|role| role.name() == name).ok_or(ParseMemberError)?;
        let id = number(next()?)?;
        let precedence = number(next()?)?;
        let since_ns = number(next()?)?;
        if id == 0 || parts.next().is_some() {
            return Err(ParseMemberError);
        }
        Ok(Self { role, id, precedence, since_ns })
    }
}

fn number<T: FromStr>(text: &str) -> Result<T, ParseMemberError> {
    text.parse().map_err(|_| ParseMemberError)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_member_comes_back_from_its_announcement() {
        let member = Member::new(Role::Controller, 3);
        assert_eq!(member.to_string().parse(), Ok(member));
        assert_ne!(member.id, Member::new(Role::Controller, 3).id);
    }

    #[test]
    fn other_text_is_not_read_as_a_member() {
        for text in
            ["", "plant", "plant/1/2", "plant/1/2/3/4", "cook/1/2/3", "plant/0/2/3", "plant/-1/2/3"]
        {
            assert_eq!(text.parse::<Member>(), Err(ParseMemberError), "{text}");
        }
    }
}
