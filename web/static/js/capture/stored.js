// IndexedDB by promises: what a request gives, and when a transaction is on disk.
export const done = (request) => new Promise((ok, no) => {
  request.onsuccess = () => ok(request.result);
  request.onerror = () => no(request.error);
});

export const finished = (transaction) => new Promise((ok, no) => {
  transaction.oncomplete = () => ok();
  transaction.onerror = transaction.onabort = () => no(transaction.error);
});
