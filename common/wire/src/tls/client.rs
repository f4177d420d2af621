//! The client's side of TLS: it knows a coordinator by its authority's fingerprint.

use std::sync::Arc;

use model::Digest;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::{Resumption, WebPkiServerVerifier};
use rustls::crypto::CryptoProvider;
use rustls::pki_types::{CertificateDer, PrivatePkcs8KeyDer, ServerName, UnixTime};
use rustls::{
    CertificateError, ClientConfig, DigitallySignedStruct, Error, RootCertStore, SignatureScheme,
};

use super::certificate::fingerprint;
use super::{ALPN, VERSIONS, provider};

/// A worker's certificate with its key.
pub struct Identity {
    /// The certificate (DER).
    pub certificate: Vec<u8>,
    /// Its key (PKCS #8, DER).
    pub key: Vec<u8>,
}

/// How a client speaks with the coordinator of an authority; `identity` is what it shows itself by, if it does.
///
/// An error says that the identity's key and certificate do not belong together, or are none.
pub fn config(authority: Digest, identity: Option<Identity>) -> Result<Arc<ClientConfig>, Error> {
    let provider = provider();
    let pinned = Pinned {
        authority,
        provider: provider.clone(),
    };
    let builder = ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(VERSIONS)?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(pinned));
    let mut config = match identity {
        None => builder.with_no_client_auth(),
        Some(Identity { certificate, key }) => {
            let key = PrivatePkcs8KeyDer::from(key).into();
            builder.with_client_auth_cert(vec![CertificateDer::from(certificate)], key)?
        }
    };
    config.alpn_protocols = vec![ALPN.to_vec()];
    // A session that is taken up again would show an old certificate.
    config.resumption = Resumption::disabled();
    Ok(Arc::new(config))
}

/// Takes whoever has a certificate that one authority signed, which it must show too.
#[derive(Debug)]
struct Pinned {
    authority: Digest,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        intermediates: &[CertificateDer<'_>],
        server_name: &ServerName<'_>,
        ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        let authority = intermediates
            .iter()
            .find(|shown| fingerprint(shown) == self.authority)
            .ok_or(CertificateError::UnknownIssuer)?;
        let mut roots = RootCertStore::empty();
        roots.add(authority.clone().into_owned())?;
        let verifier =
            WebPkiServerVerifier::builder_with_provider(roots.into(), self.provider.clone())
                .build()
                .map_err(|error| Error::General(error.to_string()))?;
        verifier.verify_server_cert(end_entity, &[], server_name, ocsp_response, now)
    }

    fn verify_tls12_signature(
        &self,
        _message: &[u8],
        _cert: &CertificateDer<'_>,
        _dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(Error::General("TLS 1.2 is not spoken".into()))
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let known = &self.provider.signature_verification_algorithms;
        rustls::crypto::verify_tls13_signature(message, cert, dss, known)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider
            .signature_verification_algorithms
            .supported_schemes()
    }
}
